from .audit import audit_people as audit_people
from .estimates import Audit as Audit
from .logged_people import (
    LoggedPeople as LoggedPeople,
    read_people as read_people,
)
