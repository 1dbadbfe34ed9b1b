"""What a robot remembers of how it gets on."""

import numpy as np

from lidarium.agents.srt.motion.progress import Progress
from lidarium.agents.srt.senses import Senses


def test_blocks_at_one_place_are_counted_in_a_row():
    def there(x, time_s):
        return Senses(time_s, np.array([x, 0.0, 0.0]), np.empty(0, np.float32), False, None, [])

    progress = Progress()
    assert [progress.note_block(there(x, 0.0)) for x in (1.0, 1.3, 1.1, 3.0, 3.2, 1.0)] == [1, 2, 3, 1, 2, 1]
    progress.stand(there(1.0, 10.0))
    assert not progress.is_stuck(there(1.01, 12.9))
    assert progress.is_stuck(there(1.01, 13.2))
    assert not progress.is_stuck(there(1.2, 13.3))
