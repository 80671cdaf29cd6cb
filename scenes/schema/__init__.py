"""Which keys a scene file may have, table by table."""
