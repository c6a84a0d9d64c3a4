"""A vehicle of 1 m/s whose steering is off by a degree: its calibration stays on the floor."""

from __future__ import annotations

import subprocess
import sys

from agvbench.campaign import Campaign

PLANT = """
import math

class Car:
    def reset(self, pose, *, seed):
        x, y, self.heading = pose  # of the middle; what moves along the heading is the rear axle
        self.x, self.y = x - 0.13 * math.cos(self.heading), y - 0.13 * math.sin(self.heading)

    def advance(self, drive, front, rear, dt):
        speed, steps = drive, max(1, round(dt / 1e-3))
        for _ in range(steps):
            h = dt / steps
            self.x += speed * math.cos(self.heading) * h
            self.y += speed * math.sin(self.heading) * h
            self.heading += speed / 0.26 * math.tan(math.radians(1.0) + 0.436 * front) * h
        return self.x + 0.13 * math.cos(self.heading), self.y + 0.13 * math.sin(self.heading), self.heading

def make_car(seed):
    return Car()
"""
VEHICLE = """
schema = 1
name = "car"
command_unit = "normalised"
neutral = 0.0
[geometry]
front_axle_m = 0.13
rear_axle_m = 0.13
driven = "rear"
[maps.front]
kind = "line_with_end_stops"
unit = "rad"
slope = 0.436
intercept = 0.0
output_low = -0.436
output_high = 0.436
[maps.rear]
kind = "fixed"
unit = "rad"
output = 0.0
command = 0.0
[maps.drive]
kind = "line"
unit = "m/s"
slope = 1.0
intercept = 0.0
command_low = -1.0
command_high = 1.0
"""


def test_no_run_of_a_calibration_is_stopped_at_the_edge(tmp_path):
    (tmp_path / "car.py").write_text(PLANT, encoding="utf-8")
    (tmp_path / "vehicle.toml").write_text(VEHICLE, encoding="utf-8")
    command = [sys.executable, "-m", "agvbench", "bench", "calibration", "--plant", "car.py:make_car", "--no-report"]
    only = ["-k", "steering and r01", "--out", "camp"]
    done = subprocess.run([*command, *only], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    statuses = [run.status for run in Campaign.open(tmp_path / "camp")]
    assert len(statuses) >= 10
    assert set(statuses) == {"ok"}
