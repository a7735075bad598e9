"""A browser that looks at a sensor: it opens the page of `gesturectl view`, and reads all that comes."""

import http.client
import json
import sys
from urllib.parse import urlsplit

address, sensor = urlsplit(sys.argv[1]), sys.argv[2]
page = http.client.HTTPConnection(address.netloc)
page.request("GET", f"/?{address.query}")
answer = page.getresponse()
cookie = answer.headers["Set-Cookie"].partition(";")[0]
answer.read()
page.request("GET", f"/stream?sensor={sensor}", headers={"Cookie": cookie})
stream = page.getresponse()
while not stream.readline().startswith(b"event: frame"):
    pass
print(json.dumps({"sees": sensor}), flush=True)
while stream.readline():
    pass
