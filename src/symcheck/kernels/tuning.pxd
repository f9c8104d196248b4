# cython: language_level=3
"""Tuning constants of the compiled loops, each with its reason.

They change the speed or the memory of a kernel, and never its result.
"""

cdef enum:
    # explore/state_table: states inserted together. Their slots and rows are prefetched, which needs
    # enough of them to cover the latency of memory; the hashes of a chunk must stay in the first cache.
    INSERT_CHUNK = 256

    # file_memory: smaller blocks stay in memory. A model that needs files has few blocks below this size.
    MAPPED_BLOCK_BYTES = 16777216

    # explore/csr_builder: a row of up to so many entries finds equal columns by linear search, which is
    # faster than a hash table that must be cleared first.
    LINEAR_SCAN_ENTRIES = 24

    # partition: operations between two checks of memory, time and signals (a power of two).
    CHECK_INTERVAL = 65536
    # partition: nodes at the first collection of unused nodes, and how many times the nodes that are left
    # may exist at the next one. Collections also drop memoised results, so they must be rare.
    FIRST_COLLECTION = 4000000
    COLLECTION_GROWTH = 4

    # explore/breadth_first: states and successors after which a batch ends. The rows of a batch must
    # stay in the second cache until they are numbered; below some hundred states prefetching has no
    # time to work.
    BATCH_STATES = 256
    BATCH_SUCCESSORS = 16384
    # explore/breadth_first: states that a thread expands at a time, a multiple of BATCH_STATES, and states
    # that must be left for threads to be used. A block takes a millisecond, and its start some 30
    # microseconds; the rows of several blocks should stay in the last cache until they are numbered.
    BLOCK_STATES = 2048
    MANY_STATES_LEFT = 4096
    # explore/breadth_first: states between two looks at the time limit.
    CLOCK_INTERVAL = 2048

    # solve/component_bounds: a block with choices of up to so many states is swept a little right away,
    # over about so many entries in all, but within these numbers of sweeps. Blocks that converge slowly
    # go to the methods for large components after that, so the effort must be small beside them.
    SWEEP_STATES = 20000
    SWEEP_ENTRIES = 50000
    MIN_SWEEPS = 24
    MAX_SWEEPS = 400

    # solve/extrapolation: differences that are combined (more of them are nearly dependent, and each
    # takes eight bytes per state), and sweeps per combination (one costs as much as two or three sweeps).
    ANDERSON_MEMORY = 5
    SWEEPS_PER_COMBINATION = 8

    # chains/gth_elimination: classes of states by the fill-in that they would cause.
    FILL_IN_CLASSES = 4096
