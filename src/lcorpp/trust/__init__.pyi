from .alarm import Alarm as Alarm, Finding as Finding
from .hypotheses import Hypotheses as Hypotheses
from .trust import Trust as Trust, TrustOptions as TrustOptions
