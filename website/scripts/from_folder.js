// Opened from a folder, the page goes on as `offline.html`, which needs no web host.

if (location.protocol === "file:") location.replace(`offline.html${location.search}${location.hash}`);
