"""A run's score as evo's result file, which ``evo_res`` compares with others (https://github.com/MichaelGrupp/evo)."""

from pathlib import Path

from semslam.errors import TrajectoryError
from semslam.eval.trajectory import MAX_DIFFERENCE, associate
from semslam.files import replaced
from semslam.runs.files import writing
from semslam.runs.results import SavedRun


def write_evo_result(run: SavedRun, path: Path) -> None:
    """Write what ``evo_ape tum groundtruth.txt trajectory.txt --align --t_max_diff 0.02 --save_results`` would.

    Args:
        run: a run with ground truth.
        path: the zip file.

    Raises:
        TrajectoryError: the run has no ground truth, or fewer than three poses have.
        ResultsError: the file cannot be written.
    """
    from evo.core.metrics import PoseRelation
    from evo.core.trajectory import PoseTrajectory3D
    from evo.main_ape import ape
    from evo.tools.file_interface import save_res_file

    if run.ground_truth is None:
        raise TrajectoryError(f"{run.directory} has no ground truth, so evo has nothing to score.")
    pairs = associate(run.trajectory, run.ground_truth, MAX_DIFFERENCE)
    label = f"{run.metrics.sequence} {run.metrics.odometry} {run.metrics.detector}"
    truth, estimate = (
        PoseTrajectory3D(poses_se3=list(poses), timestamps=pairs.timestamps) for poses in (pairs.true, pairs.estimated)
    )
    truth.name, estimate.name = f"{run.metrics.sequence} truth", label
    result = ape(truth, estimate, PoseRelation.translation_part, align=True)
    with writing(path), replaced(path) as partial:
        save_res_file(str(partial), result)
