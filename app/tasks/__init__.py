"""Long work away from the window: one runner, one worker thread, progress, cancel, typed signals.

    task = context.tasks.start("Finding the lesions", lambda progress: relocate(..., progress=progress))
    task.finished.connect(self._show_result)       # object: what the work returned
    task.failed.connect(self._show_failure)        # TaskFailure(message, advice, is_bug)
    task.cancelled.connect(self._go_back)
    overlay.attach(task)                           # app.widgets.ProgressOverlay

Every signal arrives in the GUI thread. Work runs in the order it was started.
"""

from app.tasks.failures import TaskFailure, describe_failure, install_excepthook
from app.tasks.runner import Task, TaskRunner

__all__ = ["Task", "TaskFailure", "TaskRunner", "describe_failure", "install_excepthook"]
