"""Records until there is no more room: ``python -m soak.record FOLDER BYTES``."""

import resource
import signal
import sys
import time
from pathlib import Path

from garment_sim_ros.errors import GarmentSimError
from garment_sim_ros.ros.recorder import Recorder


def main():
    folder, room = Path(sys.argv[1]), int(sys.argv[2])
    if room:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))
    try:
        with Recorder(folder) as recorder:
            while True:
                time.sleep(0.1)
                recorder.check()
    except GarmentSimError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
