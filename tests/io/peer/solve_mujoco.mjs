// SPDX-License-Identifier: Apache-2.0
// Lets an exported MuJoCo model come to rest and prints its vertices: solve_mujoco.mjs FOLDER SECONDS. `npm install` first.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import load_mujoco from '@mujoco/mujoco';

const [folder, seconds] = [process.argv[2], Number(process.argv[3])];
const mujoco = await load_mujoco();
mujoco.FS.mkdir('/model');
for (const name of ['object.xml', 'object.msh']) mujoco.FS.writeFile('/model/' + name, readFileSync(join(folder, name)));
const model = mujoco.MjModel.from_xml_path('/model/object.xml');
const data = new mujoco.MjData(model);
for (let step = 0; data.time < seconds; ++step) mujoco.mj_step(model, data);
console.log(JSON.stringify({ time: data.time, vertices: [...data.flexvert_xpos] }));
