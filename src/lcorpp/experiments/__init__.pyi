from .batch_results import write_batches as write_batches
from .comparison import (
    Comparison as Comparison,
    ComparisonOptions as ComparisonOptions,
    compare_strategies as compare_strategies,
)
from .results import write_comparison as write_comparison
from .sweeps.definition import (
    Sweep as Sweep,
    read_sweep as read_sweep,
)
from .sweeps.results import write_sweep as write_sweep
from .sweeps.running import (
    SweepResult as SweepResult,
    run_sweep as run_sweep,
)
