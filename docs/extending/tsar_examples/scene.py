"""A scene: a ball that swings over a floor. ``phase`` shifts the swing, for repetitions."""

import numpy as np

from scenes.animation import camera_to_world
from scenes.canonical import Instance, PerspectiveCamera, Rectangle, RigidTrack, Scene, Sphere
from tsar_examples.light import window
from tsar_examples.material import striped


def pendulum(phase: float) -> Scene:
    keys = np.arange(61)
    swing = np.sin(2 * np.pi * (keys / 30 + phase))  # a swing a second, 30 keys each
    places = np.stack([1.5 * swing, np.zeros(61), 0.3 * swing**2], axis=1)
    track = RigidTrack(0.0, 1 / 30, places, np.tile([0.0, 0.0, 0.0, 1.0], (61, 1)))
    lifted = np.diag([0.6, 0.6, 0.6, 1.0])
    lifted[2, 3] = 0.8
    ball = Instance(Sphere(1.0), striped((0.8, 0.2, 0.1), (0.9, 0.9, 0.8)), lifted, track, name="ball")
    grey = striped((0.5, 0.5, 0.5), (0.3, 0.3, 0.3))
    floor = Instance(Rectangle(), grey, np.diag([6.0, 6.0, 1.0, 1.0]), name="floor")
    camera = PerspectiveCamera(camera_to_world(np.array([0.0, -6.0, 2.5]), np.array([0.0, 0.0, 0.6])), 45.0)
    lights = window((-3.0, -3.0, 4.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), 30.0)
    return Scene(camera, (floor, ball), lights, ambient=(0.1, 0.1, 0.1), name="pendulum", duration_s=2.0)
