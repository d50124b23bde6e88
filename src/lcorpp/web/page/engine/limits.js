// The plan of LCORPP+limits, as lcorpp/planning/limits/randomised_policy.py: a controller with a drawn start node.

export class LimitedPlan {
  /** plan: `limits` of the model. domain: its domain. */
  constructor(plan, domain) {
    this.plan = plan;
    this.observations = domain.observations;
  }

  /** Draw the start node of a decision. prior: for evidence that is not listed. draw: from 0 to below 1. */
  drawNode(evidence, prior, draw) {
    const key = this.plan.names.map((name) => evidence[name] ?? "").join("|");
    const nodes = this.plan.starts[Object.hasOwn(this.plan.cases, key) ? this.plan.cases[key] : this.findNearest(prior)];
    let total = 0;
    for (const [node, p] of nodes) {
      total += p;
      if (draw < total) return node;
    }
    return nodes[nodes.length - 1][0];
  }

  findNearest(prior) {
    const distances = this.plan.priors.map((own) => own.reduce((sum, p, s) => sum + Math.abs(p - prior[s]), 0));
    return distances.indexOf(Math.min(...distances));
  }

  action(node) {
    return this.plan.actions[node];
  }

  follow(node, observation) {
    return this.plan.successors[node][this.observations.indexOf(observation)];
  }
}
