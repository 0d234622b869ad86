"""Parts that ask for more than their inputs."""

import datetime
import os
import random
import subprocess

from build123d import Box

from thingc import Thing

THICKNESS = float(os.environ.get("THICKNESS", 3))  # every part of this file meets this line


class Dated(Thing):
    """A plate as long as the day of the month."""

    def result(self):
        return Box(10 + datetime.date.today().day, 20, THICKNESS) - Box(datetime.datetime.now().day / 100, 1, 9)


class Speckled(Thing):
    """A plate with a hole somewhere, and one that is where it always is."""

    def result(self):
        fixed = random.Random(7)
        corner = random.uniform(1, 2)
        return Box(20, 20, THICKNESS) - Box(corner, 1, 9) - Box(
            1 + fixed.random(),
            random.random() + 1,
            9,
        )


class Called(Thing):
    """A plate as long as a program says."""

    def result(self):
        length = subprocess.run(["printf", "20"], capture_output=True, check=True).stdout
        return Box(float(length), 20, THICKNESS)
