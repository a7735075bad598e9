"""What looks on: it sees frames and contacts, and nothing of it returns into an answer."""
