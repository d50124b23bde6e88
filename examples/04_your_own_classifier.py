"""A classifier of your own: any scikit-learn classifier on arrays (people, channels, time points).

The same from the command line: `lcorpp run --learner examples/04_your_own_classifier.py:nearest`, and with
`pip install 'lcorpp[aeon]'` also `lcorpp run --learner minirocket`.
"""

from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from lcorpp import Planner, Robot, load_domain, solve
from lcorpp.decision import strategies
from lcorpp.experiments.training import simulated_training
from lcorpp.experiments.trials import Experiment, run_trials
from lcorpp.learning import Motion, SummaryFeatures, build_report, train_and_validate


def nearest(interval: float):
    """What `--learner` asks for: a function that returns a classifier, not yet trained."""
    neighbours = KNeighborsClassifier(25)
    return make_pipeline(Motion(interval=interval), SummaryFeatures(), StandardScaler(), neighbours)


def main() -> None:
    domain = load_domain("intention")
    training = simulated_training(domain, seed=0, tracks=600)
    classifier, validation = train_and_validate(nearest(training.dataset.interval), training.dataset)

    found = build_report(validation, positive="interested", prevalence={"interested": 0.4})
    told = found.classes[0]
    print(f"people told right:  {found.accuracy}")
    print(f"AUC:                {told.auc}")
    print(f"calibration error:  {told.said.error.value:.3f}, put right {told.calibrated.error.value:.3f}")
    print(f"call interested from {told.thresholds[0].probability:.2f} on where 40% are")

    # The label goes to the reasoner as it is, or as a likelihood that weighs what the reasoner knows.
    planner = Planner(domain.pomdp, solve(domain.pomdp, domain.starts()).policy)
    hard = Robot(classifier, domain.program_for(validation.confusion), planner, domain)
    soft = Robot(classifier.soft(), domain.soft_program, planner, domain)
    for name, robot in (("hard", hard), ("soft", soft)):
        trials = Experiment(domain, robot, robot.classifier, training.appearance, strategies(["L+R"]), 1)
        scores = run_trials(trials, 1000)[0][0]
        print(f"{name} evidence: accuracy {scores.accuracy.value:.3f}, F1 {scores.f1.value:.3f}")


if __name__ == "__main__":
    main()
