from .confidence import Confidence as Confidence, read_confidence as read_confidence
from .features import FEATURES as FEATURES
from .listener import Heard as Heard, Listener as Listener, Source as Source, WaveSource as WaveSource
from .recogniser import Recogniser as Recogniser, Recognition as Recognition
from .sound_device import Microphone as Microphone
from .voice import Voice as Voice, parse_voice as parse_voice
from .waves import read_wave as read_wave, write_wave as write_wave
