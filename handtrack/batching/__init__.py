"""Whole data sets: many clips of many subjects, on the cores of a machine or on a cluster."""
