from .batches import BatchResult as BatchResult
from .run import run_active_learning as run_active_learning
from .run_store import RunStore as RunStore
from .senses import (
    ActiveLearningOptions as ActiveLearningOptions,
    LearningSenses as LearningSenses,
    set_up_learning as set_up_learning,
)
