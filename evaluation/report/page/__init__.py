"""The page of a report: one file that a browser shows without a network."""

from lidarium.evaluation.report.page.document import write_page, write_replay_page
from lidarium.evaluation.report.page.replay_content import replay_of

__all__ = ["replay_of", "write_page", "write_replay_page"]
