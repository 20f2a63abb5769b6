"""Size of the content of HDF5 files, estimated before it is read."""

from collections.abc import Collection
from math import inf, prod
from pathlib import Path
from typing import Any

from jointz.io.formats.memory_limit import NUMBER_BYTES, OBJECT_BYTES, check_unpacked, memory_limit

_NEGLIGIBLE = 0.01  # of the limit: texts of any length are not looked at


def check_hdf5(path: Path, file: Any, *, skip: Collection[str] = ()) -> None:
    """Refuse a file that takes more memory than the limit.

    Whatever is linked or referred to several times counts each time: so it is read.
    """
    sizes: dict[Any, float] = {}
    check_unpacked(path, sum(_size(path, file, name, sizes) for name in file if name not in skip))


def _size(path: Path, parent: Any, link: Any, sizes: dict[Any, float]) -> float:
    """Return the bytes of what a name or a reference leads to; what holds itself has no end."""
    import h5py

    item = parent.get(link) if isinstance(link, str) else parent.file[link]
    if item is None:  # a link that leads nowhere
        return OBJECT_BYTES
    key = h5py.h5o.get_info(item.id).addr, item.file.filename
    if key not in sizes:
        sizes[key] = inf
        if isinstance(item, h5py.Group):
            sizes[key] = OBJECT_BYTES + sum(_size(path, item, name, sizes) for name in item)
        elif isinstance(item, h5py.Dataset):
            sizes[key] = OBJECT_BYTES + _size_of_samples(path, item, sizes)
        else:
            sizes[key] = OBJECT_BYTES
    return sizes[key]


def _size_of_samples(path: Path, samples: Any, sizes: dict[Any, float]) -> float:
    import h5py

    n = max(samples.size or 0, prod(samples.chunks or ()))  # a chunk is unpacked as a whole
    declared = n * max(samples.dtype.itemsize, NUMBER_BYTES)
    check_unpacked(path, declared)
    if h5py.check_ref_dtype(samples.dtype) is h5py.Reference:
        check_unpacked(path, n * OBJECT_BYTES)
        links = samples[()].ravel() if samples.shape else ([samples[()]] if samples.size else [])
        return float(declared + sum(_size(path, samples, link, sizes) for link in links if link))
    if h5py.check_vlen_dtype(samples.dtype) or _is_long_text(samples):
        check_unpacked(path, n * OBJECT_BYTES)
        return float(declared + _size_of_texts(path, samples))
    return float(declared)


def _is_long_text(samples: Any) -> bool:
    import h5py

    text = h5py.check_string_dtype(samples.dtype)
    return text is not None and text.length is None


def _size_of_texts(path: Path, samples: Any) -> float:
    """Return the bytes of texts of any length, read a few at a time: each may be the whole file."""
    longest = max(path.stat().st_size, 1)
    n = samples.size or 0
    if not samples.shape or n * longest <= _NEGLIGIBLE * memory_limit():
        return float(n * longest)
    most = max(1, memory_limit() // longest)
    total = 0.0
    for k in range(0, len(samples), most):
        total += sum(len(text) for text in samples[k : k + most].ravel())
        check_unpacked(path, total)
    return total
