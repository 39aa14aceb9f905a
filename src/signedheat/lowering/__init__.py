"""How each kind of domain becomes a discretisation."""
