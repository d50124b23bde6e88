from .bags import Bag as Bag
from .depth import DepthLocator as DepthLocator
from .detectors import (
    BackgroundDetector as BackgroundDetector,
    Detector as Detector,
    HogDetector as HogDetector,
    find_feet as find_feet,
    make_detector as make_detector,
)
from .floor import Floor as Floor, Intrinsics as Intrinsics
from .frames import Frame as Frame, FrameSource as FrameSource, ImageFolder as ImageFolder, Video as Video
from .ground_camera import GroundCamera as GroundCamera, read_homography as read_homography
from .metrics import TrackingScore as TrackingScore, score_tracks as score_tracks
from .tracker import Sample as Sample, Tracker as Tracker, TrackerOptions as TrackerOptions
from .tracking import ImageLocator as ImageLocator, Locator as Locator, track_people as track_people
