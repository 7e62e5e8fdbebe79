"""The game in a browser: the page, the folder it is served from, and the server."""
