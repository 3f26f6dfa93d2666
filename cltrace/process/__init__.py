"""How programs of cltrace begin and end."""
