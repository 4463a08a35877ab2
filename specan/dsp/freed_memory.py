"""Memory that is used again and again without going back to the system in between."""

import numpy as np

# Bytes; glibc takes note of pieces up to 32 MB. Transforms of a few rows work in 1 to 4 MB, a short file in some 20 MB.
_LARGE = 31 << 20


def keep_freed_memory() -> None:
    """Let the C library keep what it has been given back, up to 62 MB, for what is asked for next.

    Every transform asks for memory to work in. glibc gets pieces beyond a threshold from the system and gives them
    back at once, and each new page costs a fault: a fifth of the CPU time of level histories, a twelfth of that of many
    short files. The threshold becomes the size of the largest such piece that was ever freed, and twice that is kept
    (mallopt(3), M_MMAP_THRESHOLD). What is asked for here is never touched, so it takes no memory, and other C
    libraries just take it back.
    """
    np.empty(_LARGE, dtype=np.uint8)
