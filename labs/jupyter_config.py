"""JupyterLab as `make labs` starts it: reached from this machine only, and asking no network for news."""

c = get_config()  # type: ignore[name-defined]  # noqa: F821 - Jupyter gives it
c.ServerApp.ip = "127.0.0.1"
c.ServerApp.allow_root = True  # in containers one often is
c.LabApp.news_url = None
c.LabApp.check_for_updates_class = "jupyterlab.NeverCheckForUpdate"
c.LabApp.extension_manager = "readonly"
