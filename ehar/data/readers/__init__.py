"""Readers of original files: one module per format.

A reader is a function that takes the path of the files, and options, and returns motion data. Its docstring is the help
of `ehar data prepare NAME`: a line, an example, and its arguments.
"""

READERS = {  # name: module:function, imported on demand
    "bvh": "ehar.data.readers.bvh:prepare_bvh",
    "expi": "ehar.data.readers.expi:prepare_expi",
    "npz": "ehar.data.readers.npz:prepare_npz",
    "aistpp": "ehar.data.readers.aistpp:prepare_aistpp",
    "ntu": "ehar.data.readers.ntu:prepare_ntu",
    "nwucla": "ehar.data.readers.nwucla:prepare_nwucla",
    "utd-mhad": "ehar.data.readers.utd_mhad:prepare_utd_mhad",
    "pyskl": "ehar.data.readers.pyskl:prepare_pyskl",
}
