from .alarm import Alarm as Alarm
from .finding import Finding as Finding
from .hypotheses import Hypotheses as Hypotheses
from .options import TrustOptions as TrustOptions
from .trust import Trust as Trust
