"""The names of the commands."""

COMMANDS = (
    *("track", "live", "batch", "detect", "calibrate", "replay", "stability", "export"),
    "convert",
    *("info", "retrack", "diff", "recover"),
)
"""In the order of the help."""
