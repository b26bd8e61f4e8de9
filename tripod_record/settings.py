"""Parameters of the node."""

from tripod_graph.names import FIELD, FORCES, MARKERS, POINT_CLOUD
from tripod_graph.parameters import Parameter
from tripod_record.chunk import COMPRESSIONS
from tripod_record.place import MEGABYTE

DERIVED = (MARKERS, POINT_CLOUD, f"{FIELD}/*", FORCES)
"""Topics that can be computed from others: made for those who listen, and several times as large as all others."""

PARAMETERS: tuple[Parameter, ...] = (
    Parameter("directory", "recordings", "Directory in which recordings are made"),
    Parameter("name", "", "Name of the recording; empty: date and time; a number is added if taken"),
    Parameter("topics", "", "Topics or patterns (*, ?) to record, parted by spaces or commas; empty: all"),
    Parameter("exclude", "/rosout /parameter_events", "Topics or patterns not to record"),
    Parameter("derived", False, f"Record {', '.join(DERIVED)} too, which follow from other topics"),
    Parameter("autostart", True, "Record from the start on, without waiting for record/start"),
    Parameter("compression", "zstd", "Compression of the file", choices=COMPRESSIONS),
    Parameter(
        "sync_period", 0.5, "Time between two writes that reach the disk", unit="s", low=0.05, high=0.5
    ),
    Parameter(
        "min_free", 100 * MEGABYTE, "Free space needed to begin; a tenth is left for the end", unit="B", low=0
    ),
    Parameter("max_size", 0, "Size at which a file is followed by the next; 0: one file", unit="B", low=0),
    Parameter(
        "max_duration", 0.0, "Length at which a file is followed by the next; 0: one file", unit="s", low=0.0
    ),
    Parameter("queue_size", 64 * MEGABYTE, "Messages that may wait for the disk", unit="B", low=MEGABYTE),
)
