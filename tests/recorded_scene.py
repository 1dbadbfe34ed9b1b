"""A server of pages that keeps what is drawn instead of sending it."""

from contextlib import contextmanager, nullcontext
from types import SimpleNamespace


class Node(SimpleNamespace):
    """A node of a scene or a control: what it was made with, as attributes that may change."""

    visible = True
    clicked = None

    def on_click(self, callback):
        self.clicked = callback

    def press(self):
        self.clicked(None)


class Scene:
    def __init__(self):
        self.nodes, self.clicked = {}, None

    def on_click(self):
        def keep(callback):
            self.clicked = callback

        return keep

    def __getattr__(self, name):
        if name.startswith("add_"):
            return self._add
        return lambda *_, **__: None

    def reset(self):
        self.nodes.clear()

    def add_mesh_simple(self, name, vertices, triangles, **named):
        return self._add(name, vertices, triangles, vertices=vertices, **named)

    def _add(self, name, *given, **named):
        node = self.nodes[name] = Node(given=given, remove=lambda: self.nodes.pop(name), **named)
        return node


class Gui:
    def __init__(self, choices):
        self.controls, self._choices = {}, choices

    def reset(self):
        self.controls.clear()

    @contextmanager
    def add_folder(self, label):
        yield

    def configure_theme(self, **_):
        pass

    def _add(self, label, **named):
        control = self.controls[label] = Node(label=label, **named)
        return control

    def add_html(self, content):
        return self._add(f"html {len(self.controls)}", content=content)

    def add_progress_bar(self, value, color):
        return self._add("progress", value=value)

    def add_button(self, label):
        return self._add(label)

    def add_command(self, label, hotkey):
        command = self._add(f"key {hotkey}", what=label)
        command.on_trigger = command.on_click
        return command

    def add_dropdown(self, label, options, initial_value=None):
        return self._add(label, options=options, value=self._choices.get(label) or initial_value or options[0])

    def add_checkbox(self, label, value):
        return self._add(label, value=value)

    def add_slider(self, label, low, high, step, value):
        return self._add(label, value=value)

    def add_image(self, image, label, visible):
        return self._add(label, image=image)


class RecordedServer:
    """What `LiveView` draws is in ``scene.nodes`` and ``gui.controls``, by name.

    Parameters
    ----------
    **choices
        What is chosen at first in lists, by their labels.
    """

    def __init__(self, **choices):
        self.scene, self.gui, self.initial_camera = Scene(), Gui(choices), SimpleNamespace()
        self.clients = {}

    def get_clients(self):
        return self.clients

    def atomic(self):
        return nullcontext()
