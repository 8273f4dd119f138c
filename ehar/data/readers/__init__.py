"""Readers of original files: one module per format.

A reader is a function that takes the path of the files, and options, and returns motion data. Its docstring is the help
of `ehar data prepare NAME`: a line, an example, and its arguments.
"""

READERS = {  # name: module:function, imported on demand
    "arrays": "ehar.data.readers.arrays:prepare_arrays",
    "bvh": "ehar.data.readers.bvh:prepare_bvh",
    "c3d": "ehar.data.readers.c3d:prepare_c3d",
    "ntu": "ehar.data.readers.ntu:prepare_ntu",
    "nwucla": "ehar.data.readers.nwucla:prepare_nwucla",
    "utd-mhad": "ehar.data.readers.utd_mhad:prepare_utd_mhad",
    "humanml3d": "ehar.data.readers.humanml3d:prepare_humanml3d",
    "pyskl": "ehar.data.readers.pyskl:prepare_pyskl",
    "expi": "ehar.data.readers.expi:prepare_expi",
    "aistpp": "ehar.data.readers.aistpp:prepare_aistpp",
    "npz": "ehar.data.readers.npz:prepare_npz",
    "own": "ehar.data.readers.own:prepare_own",
}
