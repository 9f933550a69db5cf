"""Options that several commands share."""

from __future__ import annotations

import click

json_option = click.option("--json", "as_json", is_flag=True, help="Print numbers for machines.")
no_mesh_option = click.option("--no-mesh", is_flag=True, help="Leave the skin out.")
quiet_option = click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
