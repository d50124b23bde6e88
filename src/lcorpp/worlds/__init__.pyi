from .console import ConsoleWorld as ConsoleWorld, choose as choose
from .scripted import ScriptedWorld as ScriptedWorld
