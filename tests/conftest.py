"""What all tests share.

The same examples are drawn each time, so that a change that passed passes again. `make fuzz` draws others.
"""

import os

from hypothesis import settings

# How long an example takes on a busy machine says nothing about the code.
settings.register_profile("same", deadline=None, derandomize=True)
settings.register_profile("fuzz", deadline=None, print_blob=True)
settings.load_profile(os.environ.get("LINEFLIGHT_EXAMPLES", "same"))
