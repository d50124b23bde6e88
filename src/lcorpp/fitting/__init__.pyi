from .faults import Faults as Faults, list_faults as list_faults
from .numbers import Fit as Fit, FittedNumber as FittedNumber, fit as fit
from .records import SoftRecord as SoftRecord, read_records as read_records
