"""A browser that views a sensor: it opens the address that `gesturectl view` prints, and reads the stream."""

import http.client
import json
import sys
from urllib.parse import urlsplit

from gestured.client.web.door import HEADER

address, sensor = urlsplit(sys.argv[1]), sys.argv[2]
page = http.client.HTTPConnection(address.netloc)
page.request("POST", "/open", "{}", {HEADER: address.fragment})
secret = json.load(page.getresponse())["secret"]
page.request("GET", f"/stream?sensor={sensor}", headers={HEADER: secret})
stream = page.getresponse()
while not stream.readline().startswith(b"event: frame"):
    pass
print(json.dumps({"sees": sensor}), flush=True)
while stream.readline():
    pass
