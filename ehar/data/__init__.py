"""Motion data: recordings and their skeletons, files, scenarios cut from them, and two synthetic sets."""
