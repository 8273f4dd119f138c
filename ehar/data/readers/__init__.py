"""Readers of original files: one module per format.

A reader is a function that takes the path of the files, and options, and returns motion data. Its docstring is the help
of `ehar data prepare NAME`: a line, an example, and its arguments.
"""

READERS = {  # name: module:function, imported on demand
    "bvh": "ehar.data.readers.bvh:prepare_bvh",
    "expi": "ehar.data.readers.expi:prepare_expi",
    "aistpp": "ehar.data.readers.aistpp:prepare_aistpp",
}
