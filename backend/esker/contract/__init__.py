"""The one source of every constant, wire format and shared struct (DESIGN 2, 3, 4, 6).

Nothing here does I/O. It may know ``errors`` and ``resources``. ``contract/emit.py`` turns this room into the committed
TypeScript, WGSL, OpenCL and GLSL files; a test regenerates them and compares. Change a number here, run ``make
generate``, commit both. Import names from ``esker.contract``, not from its modules, which stand here in the order in
which generated files have them.

Conventions (DESIGN 3): metres, seconds, degrees at the interface; x east, y north, z up; little-endian.
"""

# isort: skip_file
from esker.contract.constants import *  # noqa: F403
from esker.contract.values import *  # noqa: F403
from esker.contract.tasks import *  # noqa: F403
from esker.contract.document import *  # noqa: F403
from esker.contract.operations import *  # noqa: F403
from esker.contract.imports import *  # noqa: F403
from esker.contract.exports import *  # noqa: F403
from esker.contract.lesson import *  # noqa: F403
from esker.contract.classes import *  # noqa: F403
from esker.contract.messages import *  # noqa: F403
from esker.contract.frames import *  # noqa: F403
