"""In place of Mitsuba in the processes that tests without the marker `render` start (`tests.helpers.render_marker`)."""

import os

test, _, _phase = os.environ["PYTEST_CURRENT_TEST"].rpartition(" ")
raise RuntimeError(f"{test} starts the renderer; mark it `render`")
