"""The names of the commands."""

COMMANDS = (
    *("track", "live", "batch", "detect", "calibrate", "profile", "replay", "stability", "plot"),
    *("export", "convert", "audit"),
    *("info", "retrack", "diff", "recover"),
)
"""In the order of the help."""
