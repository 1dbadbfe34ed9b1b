"""Records of episodes, to be run again or drawn.

The same version runs them again to the bit; any version shows them.
"""

from lidarium.evaluation.record.episode_record import DisplayTrack as DisplayTrack
from lidarium.evaluation.record.episode_record import EpisodeRecord as EpisodeRecord
from lidarium.evaluation.record.file import read_record as read_record
from lidarium.evaluation.record.file import write_record as write_record
from lidarium.evaluation.record.recorder import Recorder as Recorder
from lidarium.evaluation.record.replay import rerun as rerun
