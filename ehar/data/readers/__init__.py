"""Readers of original files: one file a format.

A reader is a function from where the files lie, and options, to motion data. Its docstring is the help of
`ehar data prepare NAME`: a line, an example, and its arguments.
"""

READERS = {  # by name: module:function, imported when it is asked for
    "bvh": "ehar.data.readers.bvh:prepare_bvh",
    "expi": "ehar.data.readers.expi:prepare_expi",
    "aistpp": "ehar.data.readers.aistpp:prepare_aistpp",
}
