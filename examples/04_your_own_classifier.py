"""Your own classifier: any scikit-learn classifier of arrays (people, channels, time points).

The same from the command line: `lcorpp run --learner examples/04_your_own_classifier.py:nearest`.
"""

from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from lcorpp import Planner, Reasoner, Robot, load_domain, solve
from lcorpp.assembly import simulate_training_data
from lcorpp.decision import strategies
from lcorpp.learning import Motion, SummaryFeatures, build_report, train_and_validate
from lcorpp.scoring import Experiment, run_trials


def nearest(interval: float):
    """Return an untrained classifier, as `--learner` requires."""
    neighbours = KNeighborsClassifier(25)
    return make_pipeline(Motion(interval=interval), SummaryFeatures(), StandardScaler(), neighbours)


def main() -> None:
    domain = load_domain("intention")
    (sense,) = domain.senses  # "motion"
    training = simulate_training_data(domain, sense, seed=0, tracks=600)
    classifier, validation = train_and_validate(nearest(training.dataset.interval), training.dataset)

    report = build_report(validation, positive="interested", prevalence={"interested": 0.4})
    interested = report.classes[0]
    print(f"accuracy:  {report.accuracy}")
    print(f"AUC:       {interested.auc}")
    print(f"expected calibration error:  {interested.raw.ece}, calibrated {interested.calibrated.ece}")
    print(f"best threshold at a prevalence of 40%: {interested.thresholds[0].probability:.2f}")

    # Hard evidence is the predicted label; soft evidence is the likelihood of each class.
    planner = Planner(solve(domain.pomdp, domain.start_beliefs()))
    trained = Reasoner(domain.program_for({"motion": validation.confusion}))
    hard = Robot({"motion": classifier}, trained, planner, domain)
    soft = Robot({"motion": classifier.soft()}, Reasoner(domain.soft_program()), planner, domain)
    for name, robot in (("hard", hard), ("soft", soft)):
        signals = {"motion": training.signals}
        trials = Experiment(domain, robot, robot.classifiers, signals, strategies(["L+R"]), 1)
        scores = run_trials(trials, 1000)[0][0]
        print(f"{name} evidence: accuracy {scores.accuracy.estimate:.3f}, F1 {scores.f1.estimate:.3f}")


if __name__ == "__main__":
    main()
