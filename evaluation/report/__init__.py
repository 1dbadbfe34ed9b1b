"""The report of a directory of episodes.

It has tables and plots of policies side by side.
"""

from lidarium.evaluation.analysis.episodes import read_episodes
from lidarium.evaluation.report.report import write_report

__all__ = ["read_episodes", "write_report"]
