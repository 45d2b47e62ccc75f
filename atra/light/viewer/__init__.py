"""The viewer: a scene on a page of the browser, its camera and all parameters of whole frames in people's hands."""
