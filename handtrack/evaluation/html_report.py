"""placeholder"""

from __future__ import annotations

from handtrack.evaluation.tables import Report


def to_html(report: Report) -> str:
    """placeholder"""
    return str(report)
