"""The viewer: a scene in the browser, to be turned and asked. It needs the extra `view`; only server.py knows that.

Events come in and messages go out, see messages.py. cameras.py says what an event does to a camera, session.py what a
window shows, stage.py what all windows share, and server.py carries both between here and the page.
"""
