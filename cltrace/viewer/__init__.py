"""The viewer: a scene in the browser or in a notebook, to be turned and asked. It needs the extra `view`.

Events come in and messages go out, see messages.py. cameras.py says what an event does to a camera, session.py what a
window shows and when it is drawn, and stage.py what all windows share. server.py carries both between here and the page
in browsers, widget.py in notebooks; these two alone know the extra.
"""
