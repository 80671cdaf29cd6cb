"""In place of Mitsuba in the processes that tests without the marker `render` start (`tests.helpers.render_marker`)."""

import os

raise RuntimeError(f"{os.environ.get('PYTEST_CURRENT_TEST', 'a test')} starts the renderer; mark it `render`")
