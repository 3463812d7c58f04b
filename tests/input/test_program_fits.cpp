// Reverse passes and fits by the program: what they write, and how they go on.
#include <cmath>

#include "support/program.h"

namespace limn {
namespace {

// The same bits with and without a break; what was asked is in the folder.
TEST_F(Program, FitsAndGoesOn) {
  const std::string target = files_.path("target.exr"), truth = files_.path("ball.obj");
  write_mesh(files_, "ball.obj", icosphere_mesh(1));
  ASSERT_EQ(run("render " + scene_ + " -D glow=3 --spp 4 -o " + target).status, 0);
  const std::string whole = files_.path("whole"), broken = files_.path("broken");
  const std::string fit = "fit " + scene_ + " --target " + target +
                          " --wrt screen.vertex_positions --wrt blaze.radiance --spp 2 --seed 3 "
                          "--no-report --bounds blaze.radiance=0,7 --view '" +
                          scene_ + ";glow=4' --target " + target + " --truth " + truth;
  const Outcome outcome = run(fit + " --steps 4 --snapshots 2 -o " + whole);
  ASSERT_EQ(outcome.status, 0) << outcome.text;
  // A row for every snapshot under one line of headings.
  for (const char* text : {"  step        loss  std. error  blaze.radiance.r  ",
                           "\n     0           -           -  ", "\n     4  "}) {
    EXPECT_NE(outcome.text.find(text), std::string::npos) << outcome.text;
  }
  ASSERT_EQ(run(fit + " --steps 3 --threads 2 -o " + broken).status, 0);
  ASSERT_EQ(run("fit --steps 4 --no-report --resume " + broken).status, 0);
  const auto bytes = [](const std::string& file) {
    std::ifstream stream(file, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(stream), {});
  };
  EXPECT_GT(bytes(whole + "/state.cbor").size(), 100u);
  EXPECT_EQ(bytes(whole + "/state.cbor"), bytes(broken + "/state.cbor"));
  for (const char* steps : {"", " --steps 2"}) {
    const Outcome more = run("fit --no-report --resume " + broken + steps);
    EXPECT_NE(more.text.find("4 steps are done, and --steps asks for "), std::string::npos)
        << more.text;
  }
  EXPECT_EQ(bytes(whole + "/state.cbor"), bytes(broken + "/state.cbor"));
  EXPECT_EQ(bytes(whole + "/step_00004_screen.ply"), bytes(broken + "/step_00004_screen.ply"));
  const json a = json::parse(bytes(whole + "/fit.json"));
  const json b = json::parse(bytes(broken + "/fit.json"));
  EXPECT_EQ(a["status"], "done");
  ASSERT_EQ(a["history"].size(), 4u);
  ASSERT_EQ(b["history"].size(), 4u);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(a["history"][i]["loss"], b["history"][i]["loss"]);
  ASSERT_EQ(a["snapshots"].size(), 3u);
  for (const char* key : {"chamfer", "hausdorff", "normal_angle"}) {
    EXPECT_GT(a["snapshots"][2]["meshes"][0][key].get<double>(), 0) << key;
  }
  for (const json& picture : a["snapshots"][0]["pictures"]) {
    EXPECT_GT(bytes(whole + "/" + picture.get<std::string>()).size(), 60u);
  }
  EXPECT_EQ(bytes(whole + "/history.csv").substr(0, 29), "step,loss,stderr,step_size,ha");

  const std::string again = fit + " --steps 2 -o ";
  EXPECT_NE(refused(again + whole).find("holds a fit already"), std::string::npos);
  EXPECT_NE(refused("fit --resume " + files_.path("nowhere")).find("no fit was interrupted"),
            std::string::npos);
  EXPECT_NE(refused("fit " + scene_ + " --resume " + whole).find("leave out scene"),
            std::string::npos);
  EXPECT_NE(refused("fit --spp 4 --loss l1 --no-report --resume " + whole)
                .find("leave out --spp, --loss\n"),
            std::string::npos);
  EXPECT_NE(refused("fit --steps 2 -o " + out()).find("give a scene"), std::string::npos);
  const std::string start = "fit " + scene_ + " --steps 2 -o " + files_.path("other");
  EXPECT_NE(refused(start + " --target " + target).find("give --wrt"), std::string::npos);
  EXPECT_NE(refused(start + " --wrt blaze.radiance").find("0 --target for 1 views"),
            std::string::npos);
  const std::string good = start + " --wrt blaze.radiance --target " + target;
  EXPECT_NE(refused(good + " --bounds blaze.radiance=3").find("NAME=LEAST,MOST"),
            std::string::npos);
  EXPECT_NE(refused(good + " --loss l3").find("unknown loss \"l3\""), std::string::npos);
  EXPECT_NE(refused(good + " --optimiser sgd").find("known: adam-uniform, adam"),
            std::string::npos);
  EXPECT_NE(refused(good + " --terms sky").find("no term \"sky\" here"), std::string::npos);
  const std::string small = files_.path("small.exr");
  write_exr(small, Image(2, 2, 3), false, {});
  EXPECT_NE(refused(good + " --mask " + small).find(small + ": error: the mask has 2 x 2 pixels"),
            std::string::npos);
  const std::string flat = files_.write("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
  EXPECT_NE(refused(good + " --truth " + flat).find("flat.obj: error: has no face with an area"),
            std::string::npos);
  EXPECT_FALSE(std::ifstream(files_.path("other") + "/state.cbor"));
}

// It is the pictures' mask.
TEST_F(Program, FitsOfCoverageTakeNoMask) {
  const std::string coverage = files_.path("coverage.exr"), mask = files_.path("mask.exr");
  ASSERT_EQ(run("render " + scene_ + " --alpha --spp 4 --quiet -o " + coverage).status, 0);
  Image one(8, 8, 1);
  one.data[0] = 1;
  write_exr(mask, one, false, {});
  const auto loss = [&](const std::string& folder, const std::string& more) {
    const Outcome outcome =
        run("fit " + scene_ + " --target - --alpha " + coverage + more +
            " --wrt screen.translate.x --spp 2 --steps 1 --no-report -o " + files_.path(folder));
    EXPECT_EQ(outcome.status, 0) << outcome.text;
    return read_json(files_.path(folder) + "/fit.json")["history"][0]["loss"];
  };
  const json alone = loss("alone", "");
  EXPECT_GT(alone, 0);
  EXPECT_EQ(loss("masked", " --mask " + mask), alone);
}

// A break in the blurred steps changes no bits; the folder tells their sigma.
TEST_F(Program, FitsThatBeginBlurredGoOn) {
  const std::string target = files_.path("target.exr");
  ASSERT_EQ(run("render " + scene_ + " -D glow=3 --spp 4 -o " + target).status, 0);
  const std::string whole = files_.path("whole"), broken = files_.path("broken");
  const std::string fit = "fit " + scene_ + " --target " + target +
                          " --wrt screen.translate.x --wrt blaze.radiance --spp 2 --no-report "
                          "--sigma 0.04 --sigma-end 0.01 --blur-steps 3 --steps ";
  const Outcome outcome = run(fit + "4 --snapshots 1 -o " + whole);
  ASSERT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("std. error       sigma  "), std::string::npos) << outcome.text;
  ASSERT_EQ(run(fit + "1 -o " + broken).status, 0);
  ASSERT_EQ(run("fit --steps 4 --no-report --resume " + broken).status, 0);
  EXPECT_EQ(bytes_of(whole + "/state.cbor"), bytes_of(broken + "/state.cbor"));
  const json history = json::parse(bytes_of(whole + "/fit.json"))["history"];
  const double sigmas[] = {0.04, 0.02, 0.01, 0};
  for (int i = 0; i < 4; ++i) EXPECT_DOUBLE_EQ(history[i]["sigma"], sigmas[i]);
  EXPECT_NE(bytes_of(whole + "/history.csv").find(",halvings,sigma,seconds"), std::string::npos);
  EXPECT_NE(refused(fit + "4 --terms interior -o " + out()).find("takes all terms"),
            std::string::npos);
}

// Pairs of steps and changes are in the folder, too; at rest there is nothing to go on with.
TEST_F(Program, FitsByLbfgsGoOn) {
  std::string text = bytes_of(scene_);
  const std::string depth = "name=\"max_depth\" value=\"";
  ASSERT_NE(text.find(depth), text.npos);
  text[text.find(depth) + depth.size()] = '2';  // direct light alone has a closed form
  const std::string scene = files_.write("direct.xml", text);
  const std::string target = files_.path("target.exr");
  ASSERT_EQ(run("render " + scene + " -D glow=3 --spp 4 -o " + target).status, 0);
  const std::string fit = "fit " + scene + " --target " + target +
                          " --wrt blaze.radiance --wrt clay.reflectance --spp 1 --no-report "
                          "--method analytic --optimiser lbfgs -o ";
  const std::string whole = files_.path("whole"), broken = files_.path("broken");
  const Outcome outcome = run(fit + whole + " --steps 5");
  ASSERT_EQ(outcome.status, 0) << outcome.text;
  ASSERT_EQ(run(fit + broken + " --steps 3").status, 0);
  ASSERT_EQ(run("fit --steps 5 --no-report --resume " + broken).status, 0);
  const std::string state = bytes_of(whole + "/state.cbor");
  EXPECT_EQ(state, bytes_of(broken + "/state.cbor"));
  EXPECT_GT(json::from_cbor(state)["moves"].size(), 2u);
  const json told = read_json(whole + "/fit.json");
  EXPECT_EQ(told["arguments"]["pixels"], "uniform");
  EXPECT_EQ(told["history"].back()["at_rest"], false);
  EXPECT_NE(refused(fit + files_.path("other") + " --steps 3 --pixels adjoint").find("lbfgs takes"),
            std::string::npos);

  // Nothing but its bounds to go to.
  const std::string held = files_.path("held");
  const std::string rests = "fit " + scene + " -D glow=3 --target " + target +
                            " --wrt blaze.radiance --bounds blaze.radiance=3,3 --spp 1 "
                            "--no-report --method analytic --optimiser lbfgs --steps 9 -o " +
                            held;
  ASSERT_EQ(run(rests).status, 0);
  const json end = read_json(held + "/fit.json");
  ASSERT_EQ(end["history"].size(), 1u);
  EXPECT_EQ(end["history"][0]["at_rest"], true);
  EXPECT_EQ(end["status"], "done");
  const Outcome again = run("fit --no-report --resume " + held);
  EXPECT_EQ(again.status, 0);
  EXPECT_NE(again.text.find("has converged"), std::string::npos) << again.text;
  EXPECT_EQ(read_json(held + "/fit.json")["history"].size(), 1u);
}

// Each sensor of a scene has its target.
TEST_F(Program, FitsSeenBySeveralSensors) {
  std::string text = bytes_of(scene_);
  const size_t at = text.find("<sensor"), end = text.find("</sensor>") + 9;
  std::string second = text.substr(at, end - at);
  second.replace(0, 7, "<sensor id=\"side\"");
  const size_t origin = second.find("origin=\"");
  second.replace(origin, second.find('"', origin + 8) - origin, "origin=\"3, 1, 2");
  text.insert(end, second);
  const std::string both = files_.write("both.xml", text);
  std::string targets, swapped, folder = files_.path("sensors");
  for (const char* sensor : {"0", "side"}) {
    const std::string file = files_.path(std::string(sensor) + ".exr");
    const std::string told = files_.path("told.json");
    ASSERT_EQ(
        run("render " + both + " --sensor " + sensor + " --spp 64 --json " + told + " -o " + file)
            .status,
        0);
    EXPECT_EQ(json::parse(bytes_of(told))["sensor"], sensor);
    EXPECT_EQ(attribute_of(file, "limn.sensor"), sensor);
    targets += " --target " + file;
    swapped.insert(0, " --target " + file);
  }
  EXPECT_NE(bytes_of(files_.path("0.exr")), bytes_of(files_.path("side.exr")));
  const std::string fit = "fit " + both + " --wrt blaze.radiance --spp 16 --steps 1 --no-report";
  std::vector<double> losses, variances;
  for (const std::string& order : {targets, swapped}) {
    folder += "_";
    ASSERT_EQ(run(fit + order + " -o " + folder).status, 0);
    const json first = json::parse(bytes_of(folder + "/fit.json"))["history"][0];
    ASSERT_EQ(first["views"].size(), 2u);
    losses.push_back(first["loss"]);
    variances.push_back(std::pow(first["stderr"].get<double>(), 2));
  }
  EXPECT_GT(losses[1] - losses[0], 5 * std::sqrt(variances[0] + variances[1]));
  EXPECT_NE(refused(fit + " --target " + files_.path("0.exr") + " -o " + files_.path("no"))
                .find("1 --target for 2 views"),
            std::string::npos);
  EXPECT_NE(refused("render " + both + " --sensor top -o " + out())
                .find("both.xml: error: there is no sensor \"top\" (known: 0, 1 or \"side\")"),
            std::string::npos);
}

// A shape of the second view alone, whose id is no name of a file; a field, named from where the
// program runs; new triangles after the last step.
TEST_F(Program, FitsOfLaterViewsAndFields) {
  const std::string target = files_.path("target.exr"), folder = files_.path("later");
  ASSERT_EQ(run("render " + scene_ + " --spp 1 -o " + target).status, 0);
  SceneParts parts;
  parts.width = parts.height = 8;
  const std::string ball = write_mesh(files_, "ball.obj", icosphere_mesh(1));
  parts.body = obj_shape("a/b", ball, false, 0.4, {0, 1, 0}, diffuse("clay", "0.7, 0.5, 0.3")) +
               square("lamp", 0.5, 90, {0.3, 2.4, 0.5}, area_light("blaze", "6, 5, 4"));
  const std::string second = files_.write("second.xml", scene_text(parts));
  const std::string field = "screen.vertex_positions:field.txt";
  files_.write("field.txt", "0 0 1\n0 0 1\n0 0 1\n0 0 1\n");
  const std::string fit = std::string("cd ") + files_.path("") + " && " + LIMN_PROGRAM + " fit " +
                          scene_ + " --target " + target + " --view " + second + " --target " +
                          target + " --spp 1 --steps 1 --no-report --wrt a/b.vertex_positions";
  const Outcome outcome = call(fit + " --wrt " + field + " --bounds " + field + "=-1,1 -o later");
  ASSERT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_GT(bytes_of(folder + "/step_00001_a_b.ply").size(), 500u);
  EXPECT_EQ(json::parse(bytes_of(folder + "/fit.json"))["snapshots"][1]["meshes"].size(), 2u);
  const Outcome on = run("fit --no-report --steps 2 --resume " + folder);
  EXPECT_EQ(on.status, 0) << on.text;
  files_.write("field.txt", "0 0 1\n0 0 1\n0 0 1\n0 0 2\n");
  EXPECT_NE(refused("fit --no-report --steps 3 --resume " + folder)
                .find("field.txt: error: is not as it was when the fit in "),
            std::string::npos);
  const Outcome backward = run("backward " + second + " --spp 1 --target " + target +
                               " --wrt a/b.vertex_positions -o " + files_.path("back"));
  EXPECT_EQ(backward.status, 0) << backward.text;
  EXPECT_GT(bytes_of(files_.path("back") + "/a_b.vertex_positions.ply").size(), 500u);
  EXPECT_NE(call(fit + " --wrt screen.vertex_positions:fit.json -o .")
                .text.find("fit.json: error: -o would write over a file that is read"),
            std::string::npos);
  const Outcome remeshed = call(fit + " --remesh 5 -o remeshed");
  if (remeshed.text.find("OpenMesh") == std::string::npos) {
    EXPECT_NE(remeshed.text.find("--remesh 5: the fit ends before, after 1 steps"),
              std::string::npos)
        << remeshed.text;
  }
}

TEST_F(Program, WarnsOfFitsWithoutAnExactStep) {
  const std::string target = files_.path("target.exr");
  ASSERT_EQ(run("render " + scene_ + " --spp 1 -o " + target).status, 0);
  const std::string fit = "fit " + scene_ + " --target " + target +
                          " --wrt blaze.radiance --spp 1 --sigma 0.01 --no-report --blur-steps 2 ";
  const std::string warning =
      "--blur-steps 2: the fit ends after 2 steps, before its first with exact derivatives";
  const Outcome blurred = run(fit + "--steps 2 -o " + files_.path("blurred"));
  EXPECT_EQ(blurred.status, 0) << blurred.text;
  EXPECT_NE(blurred.text.find(warning), std::string::npos) << blurred.text;
  const Outcome exact = run(fit + "--steps 3 -o " + files_.path("exact"));
  EXPECT_EQ(exact.status, 0) << exact.text;
  EXPECT_EQ(exact.text.find("--blur-steps"), std::string::npos) << exact.text;
}

// Who works in the folder is named, and what is there stays.
TEST_F(Program, FitsOfTwoProcessesDoNotShareAFolder) {
  const std::string target = files_.path("target.exr"), folder = files_.path("fit");
  ASSERT_EQ(run("render " + scene_ + " --spp 1 -o " + target).status, 0);
  const std::string fit = "fit " + scene_ + " --target " + target +
                          " --wrt blaze.radiance --spp 1 --steps 1 --no-report -o " + folder;
  std::filesystem::create_directory(folder);
  const std::string held = "flock " + folder + "/limn.lock ";
  files_.write("fit/limn.lock", "process 7 on far");
  const Outcome outcome = run(fit, held);
  EXPECT_EQ(outcome.status, 2);
  EXPECT_NE(outcome.text.find("error: process 7 on far works in this folder"), std::string::npos)
      << outcome.text;
  EXPECT_EQ(run(fit).status, 0);
  EXPECT_FALSE(std::filesystem::exists(folder + "/limn.lock"));
  EXPECT_NE(call(held + LIMN_PROGRAM + " fit --no-report --resume " + folder)
                .text.find("works in this folder"),
            std::string::npos);
}

// `timeout` and job schedulers send a process its signal, and then to its group.
TEST_F(Program, SignalsThatComeAtOnceAreOneInterrupt) {
  const std::string image = files_.path("long.exr");
  const Outcome outcome = call_and_send(
      std::string(LIMN_PROGRAM) + " render " + scene_ + " --spp 100000000 -o " + image,
      "kill -INT $!; sleep 0.01; kill -INT $!");
  EXPECT_NE(outcome.text.find("interrupted: "), std::string::npos) << outcome.text;
  EXPECT_TRUE(std::filesystem::exists(image));
}

// Steps take twice as long each, so that the interrupt comes within one, after a snapshot; where it
// meets a picture instead, which it ends, it is tried again.
TEST_F(Program, InterruptedFitsKeepPicturesAndTellWhatIsDamaged) {
  const std::string target = files_.path("target.exr"), folder = files_.path("fit");
  ASSERT_EQ(run("render " + scene_ + " --spp 1 -o " + target).status, 0);
  const std::string file = folder + "/fit.json";
  std::string text;
  json fit;
  for (int tries = 0; tries < 6; ++tries) {
    std::filesystem::remove_all(folder);
    const Outcome outcome =
        call_and_send(std::string(LIMN_PROGRAM) + " fit " + scene_ + " --target " + target +
                          " --wrt blaze.radiance --spp 1 --spp-doubling 1 --steps 40 "
                          "--snapshots 1 --no-report -o " +
                          folder,
                      "kill -INT $!");
    ASSERT_NE(outcome.text.find("interrupted: "), std::string::npos) << outcome.text;
    text = bytes_of(file);
    fit = json::parse(text);
    if (!fit["snapshots"].back()["pictures"].empty()) break;
  }
  EXPECT_EQ(fit["snapshots"].back()["step"], fit["steps"]);
  EXPECT_EQ(fit["snapshots"].back()["pictures"].size(), 1u);

  const std::string resume = "fit --no-report --resume " + folder;
  const auto says = [&](const std::string& what) {
    const std::string message = refused(resume);
    EXPECT_NE(message.find(what), std::string::npos) << message;
  };
  const auto damage = [&](const std::string& pointer, const json& value) {
    json damaged = fit;
    damaged[json::json_pointer(pointer)] = value;
    files_.write("fit/fit.json", damaged.dump());
  };
  damage("/arguments/views", json::array());
  says("fit.json: error: is not what a fit writes: it has no views");
  damage("/history/0/loss", "high");
  says("fit.json: error: is not what this fit writes: ");
  files_.write("fit/fit.json", text);
  const std::string state = bytes_of(folder + "/state.cbor");
  json other = json::from_cbor(state);
  other["parameters"].clear();
  const std::vector<uint8_t> bytes = json::to_cbor(other);
  files_.write("fit/state.cbor", std::string(bytes.begin(), bytes.end()));
  says("state.cbor: error: is the state of another fit");
  files_.write("fit/state.cbor", state);
  std::string changed = bytes_of(scene_);
  changed.replace(changed.find("0.7, 0.5, 0.3"), 3, "0.6");
  files_.write("scene.xml", changed);
  says("scene.xml: error: is not as it was when the fit in ");
  changed.replace(changed.find("0.6, 0.5, 0.3"), 3, "0.7");
  files_.write("scene.xml", changed);
  const Image image = read_exr(target);
  Image other_image = image;
  other_image.data[5] += 1;
  write_exr(target, other_image, false, {});
  says("target.exr: error: is not as it was when the fit in ");
}

// An array's files: a mesh, and a field that gradient takes.
TEST_F(Program, BackwardWritesWhatOthersRead) {
  const std::string target = out(), folder = files_.path("back");
  ASSERT_EQ(run("render " + scene_ + " --spp 2 --quiet -D glow=5,5,5 -o " + target).status, 0);
  const Outcome outcome = run("backward " + scene_ + " --spp 2 --target " + target +
                              " --wrt screen.vertex_positions --wrt blaze.radiance -o " + folder);
  ASSERT_EQ(outcome.status, 0) << outcome.text;
  for (const char* text :
       {"loss (l2)  ", "\nparameter  ", "\nscreen.vertex_positions  scene units  "}) {
    EXPECT_NE(outcome.text.find(text), std::string::npos) << outcome.text;
  }
  const json report = json::parse(std::ifstream(folder + "/gradient.json"));
  ASSERT_EQ(report["parameters"].size(), 2u);
  EXPECT_EQ(report["parameters"][0]["shape"], json({4, 3}));
  EXPECT_GT(report["loss"]["value"], 0);
  const std::string array = folder + "/screen.vertex_positions";
  EXPECT_EQ(read_mesh(array + ".ply", true).positions.size(), 4u);
  EXPECT_EQ(run("gradient " + scene_ + " --spp 1 --quiet --wrt screen.vertex_positions:" + array +
                ".txt -o " + out())
                .status,
            0);
  const std::string all = files_.path("all"), command = "backward " + scene_ + " --spp 1 --target ";
  ASSERT_EQ(run(command + target + " -o " + all).status, 0);
  EXPECT_TRUE(std::filesystem::exists(all + "/screen.vertex_positions.npy"));
  for (const json& p : json::parse(std::ifstream(all + "/gradient.json"))["parameters"]) {
    EXPECT_EQ(p["name"].get<std::string>().find("displacement"), std::string::npos);
  }
  ASSERT_EQ(run(command + target + " --wrt screen.displacement -o " + all).status, 0);
  EXPECT_TRUE(std::filesystem::exists(all + "/screen.displacement.npy"));
  EXPECT_NE(refused("backward " + scene_ + " -o " + folder).find("--adjoint or --target"),
            std::string::npos);
  const std::string small = files_.path("small.exr");
  write_exr(small, Image(2, 2, 3), false, {});
  EXPECT_NE(refused("backward " + scene_ + " --target " + small + " -o " + folder)
                .find(small + ": error: the target has 2 x 2 pixels"),
            std::string::npos);
  EXPECT_NE(refused("backward " + scene_ + " --adjoint " + target + " --terms sky -o " + folder)
                .find("no term \"sky\""),
            std::string::npos);
}

TEST_F(Program, ReversePassesKeepToTheirTime) {
  const std::string folder = files_.path("back"), again = files_.path("again");
  const std::string target = files_.path("target.exr");
  ASSERT_EQ(run("render " + scene_ + " --spp 2 --quiet -D glow=5,5,5 -o " + target).status, 0);
  const std::string command = "backward " + scene_ + " --quiet --adjoint " + target + " ";
  const Outcome outcome = run(command + "--time 0.5 -o " + folder);
  ASSERT_EQ(outcome.status, 0) << outcome.text;
  const json timed = json::parse(std::ifstream(folder + "/gradient.json"));
  // Its samples and batches say all.
  ASSERT_EQ(run(command + fmt::format("--spp {} --batches {} -o {}", timed["spp"].get<int>(),
                                      timed["batches"].get<int>(), again))
                .status,
            0);
  const json same = json::parse(std::ifstream(again + "/gradient.json"));
  EXPECT_EQ(timed["parameters"][0]["value"], same["parameters"][0]["value"]);
  EXPECT_EQ(bytes_of(folder + "/screen.vertex_positions.npy"),
            bytes_of(again + "/screen.vertex_positions.npy"));
  EXPECT_GE(timed["batches"], 2);
}

}  // namespace
}  // namespace limn
