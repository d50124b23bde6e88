from .console import ConsoleWorld as ConsoleWorld, choose as choose
