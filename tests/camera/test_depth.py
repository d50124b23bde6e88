"""People in synthetic depth images, and the way from depth images to a belief."""

import numpy as np
import pytest

from lcorpp import Instance, Planner, Reasoner, Robot, dt_control, load_domain, solve
from lcorpp.assembly import simulate_training_data
from lcorpp.camera import DepthLocator, Intrinsics, Tracker, score_tracks
from lcorpp.camera.floor import find_floor
from lcorpp.errors import DataError
from lcorpp.learning import StreamingClassifier, learner, train
from lcorpp.values import Distribution
from tests.camera.corridor import Corridor, Mount, Person, add_noise, render, walk, walk_side_by_side

SMALL = Mount(320, 240, 285.0)


def see(mount, people, seed=0, corridor=None):
    """Return an image as a `Frame` has it."""
    image = add_noise(render(mount, people, corridor), np.random.default_rng(seed))
    return np.where(image > 0, image / 1000, np.nan).astype(np.float32)


def locate(mount, people, corridor=None):
    return DepthLocator(mount.intrinsics).locate(see(mount, people, corridor=corridor))[0]


@pytest.mark.parametrize(
    "mount",
    [SMALL, Mount(160, 120, 142.0), Mount(320, 240, 285.0, 0.6, 0.0), Mount(320, 240, 285.0, 2.2, 0.5)],
)
def test_height_and_tilt_of_the_camera_are_found(mount):
    locator = DepthLocator(mount.intrinsics)
    locator.locate(see(mount, [Person(3, 0.2)]))
    assert locator.floor.height == pytest.approx(mount.camera_height, abs=0.04)
    assert locator.floor.axes()[2] == pytest.approx([0, -np.cos(mount.tilt), -np.sin(mount.tilt)], abs=0.02)


def test_the_floor_is_exact_without_noise():
    rng = np.random.default_rng(0)
    rays = rng.uniform((-0.5, 0.1), (0.5, 0.5), (500, 2))
    disparities = rays[:, 1] / 1.3  # a level camera 1.3 m above the floor: y = 1.3
    floor = find_floor(rays, disparities, rng)
    assert floor.height == pytest.approx(1.3)
    assert floor.normal == pytest.approx((0, -1, 0), abs=1e-9)


@pytest.mark.parametrize("x", [2.0, 4.0, 6.5])
@pytest.mark.parametrize("y", [-0.7, 0.0, 0.6])
def test_a_person_is_located_to_a_decimetre(x, y):
    found = locate(SMALL, [Person(x, y)])
    assert len(found) == 1
    assert found[0] == pytest.approx([x, y], abs=0.1)


def test_people_who_touch_are_two():
    found = locate(SMALL, [Person(3.5, -0.24), Person(3.5, 0.24, height=1.7)])
    assert sorted(found[:, 1].tolist()) == pytest.approx([-0.24, 0.24], abs=0.1)


@pytest.mark.parametrize("half_width", [1.0, 2.0, 30.0])
def test_a_corridor_without_people_has_none(half_width):
    assert len(locate(SMALL, [], Corridor(half_width))) == 0


def test_a_person_next_to_a_wall_is_found():
    assert locate(SMALL, [Person(4.0, 1.0)], Corridor(1.3))[0] == pytest.approx([4.0, 1.0], abs=0.15)


@pytest.mark.parametrize(
    ("scene", "count"), [(walk, 3), pytest.param(walk_side_by_side, 3, marks=pytest.mark.slow)]
)
def test_tracks_in_a_corridor(scene, count):
    rng = np.random.default_rng(5)
    locator, tracker, truth, samples = DepthLocator(SMALL.intrinsics), Tracker(), [], []
    for index, people in enumerate(scene(count, 2.5, rng)):
        samples += tracker.update(index / 10, *locator.locate(see(SMALL, people, index)))
        truth += [(index / 10, i, p.x, p.y) for i, p in enumerate(people) if SMALL.sees(p.x, p.y)]
    score = score_tracks(truth, [s for s in samples if SMALL.sees(*s[2:])], max_distance=0.5)
    assert score.mota > 0.8
    assert score.rmse < 0.1


def test_unknown_depths_are_no_people():
    locator = DepthLocator(SMALL.intrinsics)
    for empty in (np.nan, 0.0, np.inf, -1.0):
        positions, covariances = locator.locate(np.full((240, 320), empty, dtype=np.float32))
        assert (positions.shape, covariances.shape) == ((0, 2), (0, 2, 2))
    assert locator.floor is None
    locator.locate(see(SMALL, [Person(3, 0)]))
    floor = locator.floor
    locator.locate(np.full((240, 320), np.nan, dtype=np.float32))
    assert locator.floor == floor  # the last one that was seen


def test_noise_alone_is_no_person():
    rng = np.random.default_rng(0)
    image = rng.uniform(0.3, 8, (240, 320)).astype(np.float32)
    DepthLocator(SMALL.intrinsics).locate(image)  # whatever it finds, it does not fail


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.zeros((240, 320), np.uint16), "an image of shape (240, 320), uint16; expected depths in metres"),
        (np.zeros((240, 320, 3), np.float32), "shape (240, 320, 3)"),
        (np.zeros((120, 160), np.float32), "shape (120, 160); expected (240, 320), as the first one"),
    ],
)
def test_other_images_are_refused(image, message):
    locator = DepthLocator(SMALL.intrinsics)
    locator.locate(np.zeros((240, 320), np.float32))
    with pytest.raises(DataError) as caught:
        locator.locate(image)
    assert message in str(caught.value)


def test_intrinsics_are_checked():
    with pytest.raises(DataError, match="focal lengths above 0"):
        Intrinsics(0.0, 500.0, 320.0, 240.0)


def test_from_depth_to_a_belief():
    """A person walks up to the robot: images, tracks, streaming classifier, reasoner, belief, report."""
    domain = load_domain("intention")
    data = simulate_training_data(domain, domain.senses[0], seed=0, tracks=200).dataset
    classifier = train(learner("summaries", interval=data.interval, inputs=data.channels), data)
    streams = StreamingClassifier.from_trained(classifier)
    locator, tracker = DepthLocator(SMALL.intrinsics), Tracker()
    for index in range(40):
        people = [Person(5.5 - 0.08 * index, 0.3 * np.cos(index / 20), np.pi)]
        streams.push_many(tracker.update(index / 10, *locator.locate(see(SMALL, people, index))))
    assert set(streams.predictions) == {1}
    facts = {"time": "morning", "location": "library"}
    reasoner = Reasoner(domain.program)
    sense = domain.senses[0].name
    robot = Robot(
        {sense: streams.classifier(1)}, reasoner, Planner(solve(domain.pomdp, domain.start_beliefs())), domain
    )

    class Answers:
        def act(self, action):
            return "pos"

        def report(self, action):
            pass

    episode = dt_control(robot, Instance({sense: data.trajectories[0]}, facts), Answers())
    assert episode.report == "interested"
    assert isinstance(episode.marginal, Distribution)
    without = reasoner.posterior("intention", domain.evidence(facts, {}))
    assert episode.marginal["interested"] != pytest.approx(without["interested"])
