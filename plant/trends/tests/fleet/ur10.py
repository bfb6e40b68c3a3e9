"""The public UR10 set (github christianlandgraf/ipa-robot-accuracy) as recordings and a manifest for `trued diagnose --batch`.

Series A (July 2020, four days) and B (November 2020, whose times a spreadsheet spoilt: the middle of the month is taken) in parts of 400 poses in their order:
joints, points of the T-Mac in the tracker's frame, hall temperature. The nominal model is `ur10.toml` beside this file.

usage: ur10.py FOLDER_OF_THE_SET OUT
"""

import csv
import datetime
import math
import shutil
import sys
from pathlib import Path

POSES = 400
HEAD = "t_s,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,temp_C\n"
ABOUT = 'schema = "trued.recording/1"\nkind = "poses"\nsigma = { x_mm = 0.03, y_mm = 0.03, z_mm = 0.03 }\n'


def number(text):
    return float(text.replace(",", "."))


def poses(path, columns):
    """Time, joints in degrees, point in mm and temperature of each pose."""
    with open(path) as file:
        for row in list(csv.reader(file, delimiter=";"))[1:]:
            joints = [math.degrees(number(cell)) for cell in row[7:13]]
            yield row[0], joints, [number(row[i]) for i in columns], number(row[13])


def write(out, stem, part, when):
    with open(out / f"{stem}.csv", "w") as file:
        file.write(HEAD)
        for k, (_, joints, point, celsius) in enumerate(part):
            file.write(",".join(f"{value:.9g}" for value in [k, *joints, *point, celsius]) + "\n")
    (out / f"{stem}.toml").write_text(ABOUT)
    return ["[[recording]]", 'robot = "UR10"', f'files = ["{stem}.csv"]', f'recorded_at = "{when.isoformat()}Z"']


def main():
    folder, out = Path(sys.argv[1]), Path(sys.argv[2])
    out.mkdir(parents=True, exist_ok=True)
    shutil.copy(Path(__file__).with_name("ur10.toml"), out / "ur10.toml")
    manifest = ['schema = "trued.manifest/1"', "seed = 1", "[[robot]]", 'name = "UR10"', 'model = "ur10.toml"']
    july = sorted(poses(folder / "series_a_measurements_grid.csv", (14, 15, 16)), key=lambda pose: pose[0])
    for i in range(0, len(july) - POSES // 2, POSES):
        when = datetime.datetime.strptime(july[i][0], "%Y%m%d%H%M%S")
        manifest += write(out, f"a{i // POSES:02d}", july[i : i + POSES], when)
    november = list(poses(folder / "series_b_measurements_joint_configurations.csv", (14, 16, 18)))
    for i in range(0, len(november) - POSES // 2, POSES):
        when = datetime.datetime(2020, 11, 15) + datetime.timedelta(hours=4 * (i // POSES))
        manifest += write(out, f"b{i // POSES}", november[i : i + POSES], when)
    (out / "fleet.toml").write_text("\n".join(manifest) + "\n")


main()
