"""The game in a browser: the page, its folder, the server."""
