"""A benchmark with exact truth and a real detector: rendered hands, detected, tracked, measured.

See README.md beside this file.
"""
