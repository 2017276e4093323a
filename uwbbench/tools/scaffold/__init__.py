"""New plugin packages, written from templates, with tests that pass."""

from uwbbench.tools.scaffold.naming import PluginName
from uwbbench.tools.scaffold.package import write_package

__all__ = ["PluginName", "write_package"]
