"""The LZF compression (Lehmann's liblzf) of compressed pcd files."""

from __future__ import annotations

import numba as nb

from uavexp.arrays import UInt8

MOST_RATIO = 88  # three bytes copy at most 264


@nb.njit(cache=True)
def decompress(data: UInt8, out: UInt8) -> bool:
    """Fill `out` (M,) from compressed `data` (N,); False when they do not fit each other exactly."""
    read = written = 0
    while read < data.size:
        control = int(data[read])
        read += 1
        if control < 32:  # a run of literals
            length = control + 1
            if read + length > data.size or written + length > out.size:
                return False
            for i in range(length):
                out[written + i] = data[read + i]
            read += length
        else:  # a copy of what was written before
            length = control >> 5
            if length == 7:
                if read >= data.size:
                    return False
                length += int(data[read])
                read += 1
            if read >= data.size:
                return False
            begin = written - ((control & 31) << 8) - int(data[read]) - 1
            read += 1
            length += 2
            if begin < 0 or written + length > out.size:
                return False
            for i in range(length):  # one by one: a copy may run into itself
                out[written + i] = out[begin + i]
        written += length
    return bool(written == out.size)
