from .console import ConsoleWorld as ConsoleWorld
