"""From the specification of a controller to C99: specification, law, printer, templates."""
