// The program as a user meets it: exit statuses and messages.
#include <cmath>

#include "support/motion_scenes.h"
#include "support/program.h"

namespace limn {
namespace {

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
// Large pages are asked for by a second start, once, by whatever name the first one goes and with
// no standard input, too; not where the user has other wishes, or where no command is given.
TEST_F(Program, StartsAnewForLargePages) {
  const auto starts = [](const std::string& environment,
                         const std::string& command = LIMN_PROGRAM " render --help") {
    const Outcome outcome =
        call("env -u GLIBC_TUNABLES LD_DEBUG=statistics " + environment + " " + command);
    EXPECT_EQ(outcome.status, 0) << outcome.text;
    const std::string once = "total startup time", &said = outcome.text;
    size_t count = 0;
    for (size_t at = said.find(once); at != std::string::npos; at = said.find(once, at + 1))
      ++count;
    return count;
  };
  EXPECT_EQ(starts(""), 2u);
  EXPECT_EQ(starts("", LIMN_PROGRAM " render --help <&-"), 2u);
  std::filesystem::create_symlink(LIMN_PROGRAM, files_.path("by_path"));
  EXPECT_EQ(starts("PATH=" + files_.path(""), "by_path render --help"), 2u);
  EXPECT_EQ(starts("", LIMN_PROGRAM " --version"), 1u);
  EXPECT_EQ(starts("GLIBC_TUNABLES="), 1u);
  EXPECT_EQ(starts("GLIBC_TUNABLES=glibc.malloc.hugetlb=0"), 1u);
  const std::string loader = "/lib64/ld-linux-x86-64.so.2";  // it would start itself
  if (std::filesystem::exists(loader)) {
    EXPECT_EQ(starts("", loader + " " LIMN_PROGRAM " render --help"), 1u);
  }
}
#endif

TEST_F(Program, WarnsOnce) {
  const std::string mesh = files_.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 2\n");
  SceneParts parts;
  parts.width = parts.height = 2;
  parts.body = R"(  <shape type="obj"><string name="filename" value="a.obj"/></shape>
)";
  const std::string scene = files_.write("collapsed.xml", scene_text(parts));
  EXPECT_EQ(
      run("render " + scene + " --spp 1 --quiet -o " + out()).text,
      mesh + ": warning: 1 of 2 faces have two corners at the same position and are left out\n");
}

TEST_F(Program, RendersAndDifferentiates) {
  EXPECT_EQ(run("render " + scene_ + " --spp 2 --quiet -o " + out()).text, "");
  EXPECT_EQ(read_exr(out()).width, 8);
  const std::string figures = files_.path("figures.json");
  const Outcome outcome = run("gradient " + scene_ + " --spp 8 --quiet --wrt screen.translate.x" +
                              " --json " + figures + " -o " + out());
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_EQ(outcome.text, "");
  EXPECT_TRUE(std::filesystem::exists(files_.path("out_stderr.exr")));
  EXPECT_TRUE(std::filesystem::exists(files_.path("out.png")));
  std::ifstream stream(figures);
  EXPECT_EQ(nlohmann::json::parse(stream)["spp"], 8);
  EXPECT_EQ(run("info " + scene_).status, 0);
}

// The image is that of a run by samples.
TEST_F(Program, ImagesTakeALimitOfTime) {
  const std::string figures = files_.path("timed.json");
  const std::string render = "render " + scene_ + " --quiet --seed 3 --json " + figures + " -o ";
  EXPECT_EQ(run(render + out() + " --time 0.05").status, 0);
  const int spp = nlohmann::json::parse(std::ifstream(figures))["spp"];
  EXPECT_GE(spp, 1);
  const std::string other = files_.path("counted.exr");
  EXPECT_EQ(run(render + other + " --spp " + std::to_string(spp)).status, 0);
  EXPECT_EQ(read_exr(out()).data, read_exr(other).data);
  EXPECT_NE(
      refused("render " + scene_ + " --time 1 --spp 4 -o " + out()).find("--spp excludes --time"),
      std::string::npos);
}

TEST_F(Program, DifferentiatesForATime) {
  const std::string figures = files_.path("figures.json");
  const Outcome outcome = run("gradient " + scene_ + " --time 0.01 --quiet --wrt " +
                              "screen.translate.x --json " + figures + " -o " + out());
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  std::ifstream stream(figures);
  EXPECT_GE(nlohmann::json::parse(stream)["spp"], 2);  // standard errors need two
  EXPECT_TRUE(std::filesystem::exists(files_.path("out_stderr.exr")));
  EXPECT_NE(refused("gradient " + scene_ + " --time 1 --spp 4 --wrt screen.translate.x -o " + out())
                .find("--spp excludes --time"),
            std::string::npos);
}

TEST_F(Program, SharesTheWorkAmongTerms) {
  const std::string figures = files_.path("figures.json");
  const std::string gradient = "gradient " + scene_ +
                               " --wrt screen.translate.x --method forest --threads 1 --json " +
                               figures + " -o " + out();
  const auto report = [&](const std::string& arguments) {
    const Outcome outcome = run(gradient + arguments);
    EXPECT_EQ(outcome.status, 0) << outcome.text;
    std::ifstream stream(figures);
    return std::pair(nlohmann::json::parse(stream), outcome.text);
  };
  const auto [given, given_text] = report(" --spp 16 --samples 3,0.5,2");
  EXPECT_EQ(given["samples"], (nlohmann::json{{"interior", 3}, {"camera", 0.5}, {"boundary", 2}}));
  EXPECT_EQ(given["pilot_spp"], 0);
  EXPECT_EQ(given["costs"]["interior"]["samples"], 3 * 16 * 64);
  EXPECT_NE(given_text.find("3,0.5,2"), std::string::npos) << given_text;
  std::string attribute;
  for (const ImageAttribute& a : read_exr_attributes(out())) {
    if (a.name == "limn.samples") attribute = a.value;
  }
  EXPECT_EQ(attribute, "3,0.5,2");

  const auto [chosen, chosen_text] = report(" --spp 16");
  EXPECT_EQ(chosen["pilot_spp"], 4);
  EXPECT_NE(chosen_text.find("pilot of 4 spp"), std::string::npos) << chosen_text;
  const auto [brief, brief_text] = report(" --spp 7");
  EXPECT_EQ(brief["pilot_spp"], 0);
  EXPECT_EQ(brief["samples"], (nlohmann::json{{"interior", 1}, {"camera", 1}, {"boundary", 1}}));
}

TEST_F(Program, Compares) {
  const std::string folder = files_.path("folder");
  const std::string compare = "compare " + scene_ + " --wrt screen.translate.x --time 0.1" +
                              " --reference-time 0.1 --repeats 2 --quiet --no-report -o " + folder;
  const Outcome outcome = run(compare + " --methods forest,fd --sweep 2");
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_EQ(outcome.text, "");
  const auto report = [&] {
    std::ifstream stream(folder + "/compare.json");
    return nlohmann::json::parse(stream);
  };
  const nlohmann::json first = report();
  EXPECT_EQ(first["kind"], "compare");
  EXPECT_EQ(first["unit"], "scene units");
  EXPECT_EQ(first["times"], nlohmann::json({0.05, 0.1}));
  EXPECT_FALSE(first["reference"]["cached"].get<bool>());
  ASSERT_EQ(first["methods"].size(), 2u);
  for (const nlohmann::json& method : first["methods"]) {
    EXPECT_EQ(method["status"], "done");
    EXPECT_EQ(method["runs"].size(), 4u);
    EXPECT_EQ(method["summary"].size(), 2u);
    EXPECT_TRUE(method["slope"]["value"].is_number() || method["slope"].is_null());
    for (const char* key : {"image", "picture", "error_picture"}) {
      EXPECT_TRUE(std::filesystem::exists(folder + "/" + method[key].get<std::string>())) << key;
    }
    for (const char* key : {"mse", "relative_mse", "trimmed_mse", "seconds", "spp", "rays"}) {
      EXPECT_TRUE(method["summary"][1][key].is_number()) << key;
      EXPECT_TRUE(method["runs"][3][key].is_number()) << key;
    }
  }
  EXPECT_TRUE(first["methods"][1]["settings"]["step"].is_number());
  for (const char* file : {"image.png", "reference.png", "reference_stderr.exr"}) {
    EXPECT_TRUE(std::filesystem::exists(folder + "/" + file)) << file;
  }

  EXPECT_EQ(run(compare + " --methods uniform").status, 0);
  EXPECT_TRUE(report()["reference"]["cached"].get<bool>());
  EXPECT_EQ(report()["reference"]["spp"], first["reference"]["spp"]);

  const std::string other = "compare " + scene_ + " --wrt screen.translate.y --time 0.1 -o " +
                            files_.path("other") + " --reference " + folder + "/reference.exr";
  const std::string text = refused(other + " --methods forest");
  EXPECT_NE(text.find("parameter: \"screen.translate.x\" there"), std::string::npos) << text;
}

TEST_F(Program, ComparesImages) {
  const std::string folder = files_.path("folder");
  const std::string compare = "compare " + scene_ +
                              " --image --what direct --time 0.05 --reference-time 0.1" +
                              " --repeats 2 -o " + folder + " --methods path,rays";
  const Outcome outcome = run(compare);
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("error of path, over its time"), std::string::npos) << outcome.text;
  std::ifstream stream(folder + "/compare.json");
  const nlohmann::json report = nlohmann::json::parse(stream);
  EXPECT_EQ(report["kind"], "compare_images");
  EXPECT_EQ(report["what"], "direct");
  ASSERT_EQ(report["methods"].size(), 2u);
  for (const nlohmann::json& method : report["methods"]) {
    EXPECT_EQ(method["status"], "done");
    EXPECT_EQ(method["runs"].size(), 2u);
    for (const char* key : {"image", "picture", "error_picture"}) {
      EXPECT_TRUE(std::filesystem::exists(folder + "/" + method[key].get<std::string>())) << key;
    }
  }
  const Outcome again = run(compare + " --reference " + folder + "/reference.exr");
  EXPECT_NE(again.text.find("(kept)"), std::string::npos) << again.text;
}

// A Python that cannot start is as good as none.
TEST_F(Program, WithoutPythonTheDataIsWritten) {
  const std::string folder = files_.path("folder");
  const Outcome outcome = run("compare " + scene_ + " --wrt screen.translate.x --time 0.05" +
                                  " --repeats 2 --methods forest,mitsuba -o " + folder,
                              "PYTHONHOME=/nowhere ");
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("no report.html: "), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find("All data is in " + folder), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find("mitsuba missing: "), std::string::npos) << outcome.text;
  for (const char* text : {"MSE +- std. error", "error of forest, over its time"}) {
    EXPECT_NE(outcome.text.find(text), std::string::npos) << outcome.text;
  }
  EXPECT_FALSE(std::filesystem::exists(folder + "/report.html"));
  std::ifstream stream(folder + "/compare.json");
  const auto methods = nlohmann::json::parse(stream)["methods"];
  EXPECT_EQ(methods[0]["status"], "done");
  EXPECT_EQ(methods[1]["status"], "missing");
  EXPECT_NE(methods[1]["message"], "");
}

TEST_F(Program, ComparesOnlyWhatItKnows) {
  const std::string compare = "compare " + scene_ + " --wrt screen.translate.x --time 0.1 -o " +
                              files_.path("folder") + " --methods ";
  const std::string text = refused(compare + "forest,forrest");
  EXPECT_NE(text.find("unknown method \"forrest\" (known: adaptive, "), std::string::npos) << text;
  EXPECT_NE(
      text.find("fd, path, light-traced, lines, rays, blurred, blurred-published, interpolated)"),
      std::string::npos)
      << text;
  EXPECT_NE(refused(compare + "forest,forest").find("given twice"), std::string::npos);
  EXPECT_NE(refused(compare + "fd --terms interior").find("all terms in one"), std::string::npos);
  EXPECT_NE(refused(compare + "forest --spp 4").find("--time"), std::string::npos);
  EXPECT_NE(refused(compare + "forest --repeats 0").find("--repeats"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(files_.path("folder")));
}

// What a method or a kind of comparison does not read is refused.
TEST_F(Program, OptionsOfOthersAreRefused) {
  const std::string images = "compare " + scene_ + " --image --time 0.1 -o " + files_.path("f");
  const std::string fields =
      "compare " + scene_ + " --wrt screen.scale --methods fd --time 0.1 -o " + files_.path("f");
  const std::string render = "render " + scene_ + " --what ao -o " + out();
  for (const auto& [words, option] : std::vector<std::pair<std::string, std::string>>{
           {"render " + scene_ + " --lines 8 -o " + out(), "--lines"},
           {render + " --method rays --tolerance 0.1", "--tolerance"},
           {render + " --method silhouettes --rays 2", "--rays"},
           {render + " --method rays --generator independent", "--generator"},
           {fields + " --what ao", "--what"},
           {fields + " --rays 2", "--rays"},
           {images + " --methods rays --lines 2", "--lines"},
           {images + " --methods path --no-report", "--no-report"}}) {
    const Outcome outcome = run(words);
    EXPECT_EQ(outcome.status, 2) << outcome.text;
    EXPECT_NE(outcome.text.find(option + ": "), std::string::npos) << words << '\n' << outcome.text;
  }
}

TEST_F(Program, ChecksBothWays) {
  const std::string check = "check " + scene_ + " --spp 2048 --block 2 --wrt screen.translate.y";
  const Outcome right = run(check);
  // Too few samples for a verdict are no accusation.
  EXPECT_TRUE(right.status == 0 || right.status == 4) << right.text;
  EXPECT_NE(right.text.find("detectable error"), std::string::npos);
  const Outcome wrong = run(check + " --terms interior,camera,boundary");
  EXPECT_EQ(wrong.status, 1) << wrong.text;
  EXPECT_NE(wrong.text.find("suspect the direct term"), std::string::npos) << wrong.text;
}

// Whatever the method: images, standard errors and figures of every parameter.
TEST_F(Program, GradientsByAnyMethod) {
  for (const std::string method : {"forest", "uniform", "fd"}) {
    const Outcome outcome =
        run("gradient " + scene_ + " --wrt screen.translate.x --wrt screen.translate.y --spp 8" +
            " --method " + method + " --stats --json " + files_.path("g.json") + " -o " + out());
    EXPECT_EQ(outcome.status, 0) << outcome.text;
    EXPECT_NE(outcome.text.find("\nset-up "), std::string::npos) << outcome.text;
    for (const char* parameter : {"screen.translate.x", "screen.translate.y"}) {
      const std::string stem = files_.path("out_" + std::string(parameter));
      for (const char* ending : {".exr", ".png", "_stderr.exr"}) {
        EXPECT_TRUE(std::filesystem::exists(stem + ending)) << method << stem << ending;
        std::filesystem::remove(stem + ending);
      }
    }
    std::ifstream stream(files_.path("g.json"));
    const auto figures = nlohmann::json::parse(stream);
    EXPECT_EQ(figures["method"], method);
    EXPECT_EQ(figures["costs"].size(), method == "fd" ? 1u : 3u);
    EXPECT_EQ(figures["parameters"].size(), 2u);
  }
  EXPECT_NE(refused("gradient " + scene_ + " --wrt screen.translate.x --method fd --terms " +
                    "interior -o " + out())
                .find("\"fd\" has all terms in one"),
            std::string::npos);
}

// On the terminal and in the files.
TEST_F(Program, FastestSaysWhatItChose) {
  const Outcome outcome = run("gradient " + scene_ + " --wrt screen.translate.x --spp 16 " +
                              "--method fastest --json " + files_.path("g.json") + " -o " + out());
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("\nchosen: "), std::string::npos) << outcome.text;
  std::ifstream stream(files_.path("g.json"));
  const auto figures = nlohmann::json::parse(stream);
  EXPECT_EQ(figures["method"], "fastest");
  const std::string chosen = figures["settings"]["chosen"];
  EXPECT_EQ(chosen == "fd (biased)",
            outcome.text.find("is biased, as a root mean square") != std::string::npos);
  std::ifstream image(files_.path("out.exr"), std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(image), {}};
  EXPECT_NE(bytes.find(chosen), std::string::npos);
}

TEST_F(Program, ChecksAnyMethodButDifferences) {
  const std::string check = "check " + scene_ + " --block 2 --wrt screen.translate.y --method ";
  const Outcome outcome = run(check + "li2019 --spp 512");
  EXPECT_TRUE(outcome.status == 0 || outcome.status == 4) << outcome.text;
  for (const std::string method : {"fd", "fastest", "fastest:film=fixed"}) {
    EXPECT_EQ(refused(check + method + " --spp 2"),
              "error: the method \"" + method +
                  "\" takes finite differences (or may), and a check would compare them with "
                  "themselves: choose another method, for example adaptive\n");
  }
}

// What it tells to take can be taken: a whole number, more than there were.
TEST_F(Program, CheckTellsHowManySamplesToTake) {
  for (const int spp : {2, 4, 16}) {
    const std::string said = run("check " + scene_ + " --spp " + std::to_string(spp) +
                                 " --wrt screen.translate.y --samples 1,1,1")
                                 .text;
    const std::string before = "--spp ";
    const size_t at = said.find(before);
    ASSERT_NE(at, std::string::npos) << said;
    const std::string number =
        said.substr(at + before.size(), said.find('\n', at) - at - before.size());
    EXPECT_EQ(number.find_first_not_of("0123456789"), std::string::npos) << said;
    EXPECT_GT(std::stoi(number), spp) << said;
  }
}

// A sample done again adds what it added in its run: with one sample per pixel, the pixel's value.
TEST_F(Program, RepeatsOneSample) {
  const std::string gradient =
      "gradient " + scene_ + " --wrt screen.translate.x --method forest -o " + out();
  const Outcome whole = run(gradient + " --spp 1 --samples 1 --terms boundary");
  EXPECT_EQ(whole.status, 0) << whole.text;
  const Image image = read_exr(out());
  int brightest = 0;
  for (int i = 0; i < image.width * image.height; ++i) {
    const auto size = [&](int k) { return std::fabs(image.data[3 * k]); };
    if (size(i) > size(brightest)) brightest = i;
  }
  ASSERT_NE(image.data[3 * brightest], 0);
  const Outcome one = run(gradient + " --spp 1 --samples 1 --terms boundary --debug-sample " +
                          std::to_string(brightest % image.width) + "," +
                          std::to_string(brightest / image.width) + ",0");
  EXPECT_EQ(one.status, 0) << one.text;
  EXPECT_NE(one.text.find("vertex 0: face "), std::string::npos) << one.text;
  const std::string sum = "sum: boundary of parameter 1: (";
  const size_t place = one.text.find(sum);
  ASSERT_NE(place, std::string::npos) << one.text;
  EXPECT_NEAR(std::stod(one.text.substr(place + sum.size())), image.data[3 * brightest],
              1e-5 * std::fabs(image.data[3 * brightest]));
  EXPECT_NE(refused(gradient + " --debug-sample 1,2").find("there is no sample 2 of the term"),
            std::string::npos);
  EXPECT_NE(refused(gradient + " --debug-sample 9999,0,0").find("pixels of this film"),
            std::string::npos);
  EXPECT_NE(refused(gradient + " --debug-sample here").find("X,Y,S"), std::string::npos);
  EXPECT_NE(
      refused("render " + scene_ + " -o " + out() + " --debug-sample 0,0,-1").find("no sample -1"),
      std::string::npos);
}

// Also those that are even together: what a pixel's samples add alone is what the run has, of which
// the last batch is cut.
TEST_F(Program, RepeatsEverySampleOfAPixel) {
  constexpr int kSamples = 11;
  const std::string gradient =
      "gradient " + scene_ + " --wrt blaze.radiance --samples 3" + " --terms interior -o " + out();
  EXPECT_EQ(run(gradient + " --spp " + std::to_string(kSamples)).status, 0);
  const Image image = read_exr(out());
  size_t brightest = 0;
  for (size_t i = 0; i < image.data.size(); i += 3) {
    if (std::fabs(image.data[i]) > std::fabs(image.data[brightest])) brightest = i;
  }
  const double mean = image.data[brightest];
  ASSERT_NE(mean, 0);
  const size_t pixel = brightest / 3, width = static_cast<size_t>(image.width);
  double sum = 0;
  for (int s = 0; s < kSamples; ++s) {
    const Outcome one = run(gradient + " --debug-sample " + std::to_string(pixel % width) + "," +
                            std::to_string(pixel / width) + "," + std::to_string(s));
    const std::string value = "sum: interior of parameter 1: (";
    const size_t place = one.text.find(value);
    ASSERT_NE(place, std::string::npos) << one.text;
    sum += std::stod(one.text.substr(place + value.size()));
  }
  EXPECT_NEAR(sum / kSamples, mean, 1e-5 * std::fabs(mean));
}

// Samples that are not finite are an error, with the command that shows the first; what is finite
// is kept. Here a corner touches the pinhole.
TEST_F(Program, NonFiniteSamplesAreAnErrorThatCanBeRepeated) {
  // A pixel of 1e30 changes within 1e-12: by more than a float holds.
  files_.write("tiny.obj", "v -1e-12 -1e-12 0\nv 1e-12 -1e-12 0\nv 0 1e-12 0\nf 1 2 3\n");
  const std::string scene = files_.write("tiny.xml", R"(<scene version="3.0.0">
<integrator type="path"><integer name="max_depth" value="2"/></integrator>
<sensor type="perspective"><float name="fov" value="40"/><float name="near_clip" value="1e-14"/>
<transform name="to_world"><lookat origin="0, 0, 4e-12" target="0, 0, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="4"/><integer name="height" value="4"/>
<rfilter type="box"/></film></sensor>
<shape type="obj" id="sheet"><string name="filename" value="tiny.obj"/></shape>
<emitter type="constant"><rgb name="radiance" value="1e30"/></emitter></scene>
)");
  const Outcome outcome =
      run("gradient " + scene + " --wrt sheet.translate.y --spp 2 --samples 1 -o " + out());
  EXPECT_EQ(outcome.status, 3) << outcome.text;
  EXPECT_NE(outcome.text.find("non-finite sample"), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find("  to see the first: limn gradient "), std::string::npos)
      << outcome.text;
  EXPECT_NE(outcome.text.find(" --debug-sample "), std::string::npos) << outcome.text;
  EXPECT_TRUE(std::filesystem::exists(out()));
}

TEST_F(Program, MethodsAndTheirSettingsAreListed) {
  const std::string brief = run("methods").text;
  const std::string all = run("methods --all").text;
  for (const std::string& text : {brief, run("gradient --help").text}) {
    EXPECT_EQ(text.find("concave"), std::string::npos) << text;
    EXPECT_NE(text.find("li2019"), std::string::npos) << text;
  }
  EXPECT_NE(all.find("    concave=off|on  "), std::string::npos) << all;
}

// Names of earlier versions tell those of today.
TEST_F(Program, OldSpellingsNameTheNew) {
  const std::string wrt = scene_ + " --wrt screen.translate.x -o " + out();
  const auto tells = [&](const std::string& command, const std::string& text) {
    const std::string told = refused(command);
    EXPECT_NE(told.find(text), std::string::npos) << told;
  };
  tells("render " + scene_ + " --sampler padded-sobol -o " + out(), "--generator sobol");
  for (const char* command : {"gradient ", "backward ", "fit "}) {
    tells(command + wrt + " --sampler forest", "this option is now --method NAME");
  }
  tells("gradient " + wrt + " --method forest-concave",
        "the method \"forest-concave\" is called forest:concave=on");
  tells("gradient " + wrt + " --method path",
        "the method \"path\" is not available for gradient (known: adaptive, ");
  tells("backward " + wrt + " --method silhouettes:directions=moving",
        "is not available for backward");
  tells("compare " + wrt + " --time 1 --methods forest,forest:width=3", "one of 8, 4, 2");
  tells("compare " + wrt + " --time 1 --methods forest,forest:width=8", "is given twice");
}

TEST_F(Program, UnknownParameterListsTheNearest) {
  const std::string text = refused("gradient " + scene_ + " --wrt scren.translate.x -o " + out());
  EXPECT_NE(text.find("\"scren.translate.x\""), std::string::npos) << text;
  EXPECT_NE(text.find("screen.translate.x"), std::string::npos) << text;
  EXPECT_FALSE(std::filesystem::exists(out()));
}

TEST_F(Program, UnknownNamesListTheKnown) {
  const std::string gradient = "gradient " + scene_ + " --wrt screen.translate.x -o " + out();
  EXPECT_NE(refused(gradient + " --method forrest").find("brute"), std::string::npos);
  EXPECT_NE(refused(gradient + " --terms interior,border").find("boundary"), std::string::npos);
  EXPECT_NE(refused("render " + scene_ + " --shading phong -o " + out()).find("continuous"),
            std::string::npos);
  EXPECT_NE(
      refused("paint " + scene_)
          .find("limn paint: no such command (known: info, render, gradient, backward, fit, "
                "merge, check, compare, reject, methods, reconstruct, bake, relight; limn --help "
                "tells more)"),
      std::string::npos);
  EXPECT_NE(refused("").find("limn: a command is needed (known: info"), std::string::npos);
}

TEST_F(Program, BadNumbers) {
  const std::string render = "render " + scene_ + " -o " + out();
  EXPECT_NE(refused(render + " --spp 0").find("--spp"), std::string::npos);
  EXPECT_NE(refused(render + " --spp many").find("--spp"), std::string::npos);
  EXPECT_NE(refused(render + " --threads 0").find("--threads"), std::string::npos);
  EXPECT_NE(refused(render + " --seed -1").find("--seed"), std::string::npos);
  const std::string gradient = "gradient " + scene_ + " --wrt screen.translate.x -o " + out();
  for (const char* bad : {"--step nan", "--step 1e300", "--step -1", "--time nan", "--time inf",
                          "--seed 12345678901234567890123", "--kappa nan"}) {
    const std::string text = refused(gradient + " --method fd " + bad);
    const std::string option = std::string(bad).substr(0, std::string(bad).find(' '));
    EXPECT_NE(text.find(option + ": "), std::string::npos) << bad << '\n' << text;
    EXPECT_NE(text.find(" is not a number from "), std::string::npos) << bad << '\n' << text;
  }
  EXPECT_EQ(run(render + " --spp 1 --seed 18446744073709551615").status, 0);
  const std::string seed = refused(render + " --seed 12345678901234567890123");
  EXPECT_NE(seed.find("from 0 to 18446744073709551615\n"), std::string::npos) << seed;
  EXPECT_NE(refused("check " + scene_ + " --wrt screen.translate.x --step 0").find("--step"),
            std::string::npos);
  EXPECT_EQ(refused("check " + scene_ + " --wrt screen.translate.x --spp 1"),
            "error: check needs --spp of at least 2, for standard errors\n");
}

// Before anything is rendered.
TEST_F(Program, CoverageRefusesWhatItCannotTake) {
  const std::string coverage = " --alpha --spp 1 -o " + out();
  EXPECT_NE(refused("render " + scene_ + " --points faces" + coverage).find("--alpha takes a ray"),
            std::string::npos);
  SceneParts parts;
  parts.body =
      animated(square("screen", 1, 0, {0, 0, 0}, diffuse("paper", "0.8, 0.8, 0.8")), {1, 0, 0});
  const std::string moving = files_.write("moving.xml", with_shutter(parts, 0, 1));
  EXPECT_NE(refused("render " + moving + coverage).find("--alpha"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(out()));
  const std::string target = files_.path("target.exr");
  ASSERT_EQ(run("render " + scene_ + " --alpha --spp 1 --quiet -o " + target).status, 0);
  EXPECT_NE(refused("backward " + scene_ + " --what alpha --loss relative-l2 --target " + target +
                    " --wrt screen.translate.x -o " + files_.path("back"))
                .find("coverage is not radiance"),
            std::string::npos);
}

// A later one is found before the first is checked.
TEST_F(Program, ChecksAlongPathsRefuseWhatMovesThem) {
  const std::string text = refused(
      "check " + scene_ + " --same-paths --spp 1 --wrt blaze.radiance.r --wrt screen.scale");
  EXPECT_NE(text.find("\"screen.scale\" moves edges"), std::string::npos) << text;
  EXPECT_EQ(text.find("blaze.radiance.r"), std::string::npos) << text;
}

// The options of a method that is not asked for are a mistake, whatever the command.
TEST_F(Program, AuxiliaryRaysAreForMethodsThatTraceThem) {
  const std::string where = scene_ + " --wrt screen.translate.x --aux 4";
  const std::string whose = "(kappa) are for the method was: ";
  const std::pair<std::string, std::string> mistakes[] = {
      {"gradient " + where + " -o " + out(), "the method \"adaptive\" has none"},
      {"check " + where + " --method fd", "the method \"fd\" has none"},
      {"check " + where + " --reverse", "the method \"adaptive\" has none"},
      {"compare " + where + " --time 0.1 --methods forest,fd -o " + files_.path("folder"),
       "none of the methods forest, fd has any"}};
  for (const auto& [command, text] : mistakes) {
    EXPECT_EQ(refused(command), "error: auxiliary rays and their kernel " + whose + text + "\n");
  }
  const std::string right = "check " + where + " --method was --spp 2";
  EXPECT_EQ(run(right).status, 4) << run(right).text;
}

// Whose samplers are other ones than the default method.
TEST_F(Program, ACheckOfReverseModeNeedsNoSampler) {
  const std::string check = "check " + scene_ + " --wrt screen.translate.x --spp 16 --reverse";
  for (const char* more : {"", " --method uniform"}) {
    const auto [status, text] = run(check + more);
    EXPECT_EQ(status, 0) << text;
    EXPECT_NE(text.find("screen.translate.x: forward"), std::string::npos) << text;
  }
  EXPECT_NE(refused(check + " --method fd").find("is not available for backward"),
            std::string::npos);
}

TEST_F(Program, BadSamples) {
  const std::string gradient =
      "gradient " + scene_ + " --wrt screen.translate.x --method forest -o " + out();
  for (const char* samples : {"3,", "3,1,1,1", "3:1:1", "0,1,1", "1,0,1", "1,1,0.5", "1.5,1,1",
                              "1,1,2000", "-1,1,1", "many"}) {
    const std::string message = refused(gradient + " --samples=" + samples);
    EXPECT_NE(message.find("--samples"), std::string::npos) << samples << ": " << message;
    EXPECT_NE(message.find("3,0.5,1"), std::string::npos) << samples << ": " << message;
  }
}

TEST_F(Program, BadDefines) {
  const std::string render = "render " + scene_ + " -o " + out();
  EXPECT_EQ(refused(render + " -D glow"), "error: -D glow: expected NAME=VALUE\n");
  EXPECT_NE(refused(render + " -D gloww=3").find("(known: glow)"), std::string::npos);
  EXPECT_NE(refused(render + " -D glow=bright").find("scene.xml:"), std::string::npos);
}

TEST_F(Program, OutputsThatCannotBeWritten) {
  const std::string text = refused("render " + scene_ + " -o /proc/no/such.exr");
  EXPECT_NE(text.find("/proc/no/such.exr: error: cannot be written"), std::string::npos) << text;
  EXPECT_NE(refused("render " + scene_ + " -o " + files_.path("out.jpg")).find(".exr"),
            std::string::npos);
}

TEST_F(Program, OutputsThatCollide) {
  const std::string gradient = "gradient " + scene_ + " --spp 2 --quiet --wrt screen.translate.x";
  EXPECT_NE(refused(gradient + " -o " + out() + " --json " + out())
                .find("-o and --json would both write this file"),
            std::string::npos);
  EXPECT_NE(
      refused(gradient + " --wrt screen.translate.x -o " + out()).find("would have this name"),
      std::string::npos);
  EXPECT_NE(refused(gradient + " -o " + out() + " --json " + scene_)
                .find("--json would write over a file that is read"),
            std::string::npos);
  const std::string link = files_.path("link.json");  // another name of the file
  std::filesystem::create_hard_link(scene_, link);
  EXPECT_NE(refused(gradient + " -o " + out() + " --json " + link)
                .find("--json would write over a file that is read"),
            std::string::npos);
  EXPECT_NE(refused("check " + scene_ + " --wrt screen.translate.x --json " + files_.path("."))
                .find("it is a folder"),
            std::string::npos);
  // Folders are made for --json as for -o.
  EXPECT_EQ(run("info " + scene_ + " --json " + files_.path("new/x.json")).status, 0);
  EXPECT_TRUE(std::filesystem::exists(files_.path("new/x.json")));
  EXPECT_NE(refused("info " + scene_ + " --json " + scene_ + "/x.json").find("cannot be written"),
            std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(out()));
}

TEST_F(Program, NothingOldLiesBesideANewImage) {
  const auto there = [&](const char* ending) {
    return std::filesystem::exists(files_.path(std::string("out") + ending));
  };
  files_.write("out_notes.exr", "not an image");
  const std::string gradient = "gradient " + scene_ + " --quiet -o " + out();
  EXPECT_EQ(run(gradient + " --spp 2 --sample-images --wrt screen.translate.x" +
                " --wrt screen.translate.y")
                .status,
            0);
  EXPECT_TRUE(there("_screen.translate.y_stderr.exr") && there("_samples_camera.exr"));
  EXPECT_EQ(run(gradient + " --spp 2 --wrt screen.translate.x").status, 0);
  EXPECT_FALSE(there("_screen.translate.y.exr") || there("_screen.translate.y.png") ||
               there("_screen.translate.y_stderr.exr") || there("_samples_camera.exr"));
  EXPECT_TRUE(there(".exr") && there("_stderr.exr"));
  EXPECT_EQ(run("render " + scene_ + " --spp 1 --quiet -o " + out()).status, 0);
  EXPECT_FALSE(there("_stderr.exr"));
  EXPECT_TRUE(there("_notes.exr"));
}

// A file that may not grow is as good as a full disk.
TEST_F(Program, FullDisksAreAnError) {
  const Outcome outcome =
      run("gradient " + scene_ + " --spp 2 --quiet --wrt screen.translate.x" + " -o " + out(),
          "trap '' XFSZ; ulimit -f 1; ");
  EXPECT_EQ(outcome.status, 2) << outcome.text;
  EXPECT_NE(outcome.text.find("cannot write"), std::string::npos) << outcome.text;
  EXPECT_FALSE(std::filesystem::exists(out()));
}

// A link to a file that is not there yet is written through.
TEST_F(Program, LinksStay) {
  const std::string link = files_.path("link.exr");
  std::filesystem::create_symlink(out(), link);
  ASSERT_EQ(run("render " + scene_ + " --spp 1 -o " + link).status, 0);
  EXPECT_TRUE(std::filesystem::is_symlink(link));
  EXPECT_EQ(read_exr(out()).width, 8);
}

// Of a scheduler, or of a terminal that closes.
TEST_F(Program, SignalsThatEndItLeaveWhatIsDone) {
  for (const std::string signal : {"TERM", "HUP"}) {
    const Outcome outcome =
        call_and_send(std::string("env --default-signal=HUP ") + LIMN_PROGRAM + " gradient " +
                          scene_ + " --quiet --spp 1000000000 --wrt screen.translate.x -o " + out(),
                      "kill -" + signal + " $!");
    EXPECT_EQ(outcome.status, 130) << outcome.text;
    EXPECT_TRUE(std::filesystem::remove(out())) << signal;
  }
}

// The loss is there before the first batch of its derivative.
TEST_F(Program, InterruptedReversePassesKeepTheLoss) {
  const std::string target = files_.path("target.exr"), folder = files_.path("back");
  ASSERT_EQ(run("render " + scene_ + " --spp 1 -o " + target).status, 0);
  // All derivatives in one batch, which takes longer than both images.
  const Outcome outcome =
      call(std::string("{ ") + LIMN_PROGRAM + " backward " + scene_ +
           " --spp 20000 --batches 1 --target " + target + " -o " + folder + " & while [ ! -e " +
           folder + "/adjoint.exr ]; do sleep 0.02; done; " + "kill -TERM $!; wait $!; }");
  EXPECT_EQ(outcome.status, 130) << outcome.text;
  EXPECT_NE(outcome.text.find("the loss alone is written"), std::string::npos) << outcome.text;
  EXPECT_TRUE(std::filesystem::exists(folder + "/adjoint.exr"));
}

// Every warning of `info` stands in the figures of a run, too.
TEST_F(Program, WarningsAreInTheFigures) {
  files_.write("a.obj", "v 0.3 0.2 0\nv 1.1 0.2 0\nv 0.3 0.9 0\nf 1 2 3\nf 1 2 2\n");
  SceneParts parts;
  parts.width = parts.height = 2;
  parts.body = R"(  <shape type="obj" id="a"><string name="filename" value="a.obj"/></shape>
  <shape type="rectangle" id="b"><transform name="to_world"><translate z="1"/></transform></shape>
  <shape type="rectangle" id="c"><transform name="to_world"><translate x="1" z="1"/></transform>
  </shape>
)";
  const std::string scene = files_.write("warned.xml", scene_text(parts));
  const std::string figures = files_.path("figures.json");
  const auto warnings = [&](const std::string& arguments) {
    run(arguments + " --json " + figures);
    std::ifstream stream(figures);
    const auto report = nlohmann::json::parse(stream);
    return (report.is_array() ? report[0] : report)["warnings"];
  };
  const auto of_info = warnings("info " + scene);
  ASSERT_EQ(of_info.size(), 2u);  // a face without area, shapes that overlap
  const std::string wrt = " --spp 2 --quiet --wrt a.translate.x";
  const auto of_gradient = warnings("gradient " + scene + wrt + " -o " + out());
  for (size_t i = 0; i < of_info.size(); ++i) EXPECT_EQ(of_gradient[i], of_info[i]);
  EXPECT_EQ(warnings("check " + scene + wrt), of_info);
  EXPECT_EQ(warnings("render " + scene + " --spp 1 --quiet -o " + out()), of_info);
  EXPECT_EQ(warnings("check " + scene + wrt + " --shading mitsuba").size(), 3u);
}

TEST_F(Program, ShowsRejection) {
  const std::string mesh = write_mesh(files_, "ball.obj", torus_mesh(16, 8));
  const std::string folder = files_.path("rejection");
  const Outcome outcome =
      run("reject " + mesh + " --no-report --size 32 --points 8 --node-edges 40 -o " + folder);
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("acceptance rate"), std::string::npos) << outcome.text;
  const nlohmann::json report = read_json(folder + "/reject.json");
  EXPECT_EQ(report["kind"], "reject");
  EXPECT_EQ(report["edges"], 3 * 16 * 8);
  EXPECT_EQ(report["variants"].size(), 4u);
  std::vector<std::string> pictures;
  for (const auto& variant : report["variants"]) {
    EXPECT_GE(variant["reached_per_silhouette"], 1);
    EXPECT_EQ(variant["slices"].size(), 2u);
    for (const auto& slice : variant["slices"]) {
      pictures.push_back(slice["picture"]);
      EXPECT_EQ(slice["points"], 32 * 32);
      EXPECT_EQ(slice["missed"], 0);
    }
  }
  for (const std::string& picture : pictures)
    EXPECT_GT(std::filesystem::file_size(folder + "/" + picture), 100u) << picture;
}

TEST_F(Program, ShowsRejectionInAScene) {
  const std::string folder = files_.path("rejection");
  const std::string reject = "reject " + scene_ +
                             " --no-report --quiet --methods forest --size 16 --points 4 -o " +
                             folder;
  const Outcome outcome = run(reject + " --shape screen --node 0");
  EXPECT_EQ(outcome.status, 0) << outcome.text;
  EXPECT_EQ(outcome.text, "");
  EXPECT_EQ(read_json(folder + "/reject.json")["shape"], "screen");
  EXPECT_NE(refused(reject + " --shape scren")
                .find("no shape has the id \"scren\" (known: floor, "
                      "screen, lamp)"),
            std::string::npos);
  EXPECT_NE(refused(reject + " --node 4000").find("--node 4000: forest has nodes 0 to"),
            std::string::npos);
  EXPECT_NE(refused(reject + " --methods forest,brute")
                .find("\"brute\" is no sampler with a rejection test (known: "
                      "forest, silhouettes, li2019,"),
            std::string::npos);
  EXPECT_EQ(refused("reject no/such.ply -o " + folder),
            "no/such.ply: error: cannot read: No such file or directory\n");
  EXPECT_NE(refused("reject " + scene_ + " -o /proc/no/such").find("/proc/no/such"),
            std::string::npos);
}

TEST_F(Program, MissingSceneAndHelp) {
  EXPECT_EQ(refused("info no/such.xml"),
            "no/such.xml: error: cannot read: No such file or directory\n");
  EXPECT_EQ(refused("info /proc"), "/proc: error: cannot read: Is a directory\n");
  EXPECT_EQ(
      refused("info no.xml --ssp 4"),
      "error: limn info: no such option: --ssp (nearest: --spp, --help, --seed; limn info --help "
      "tells more)\n");
  EXPECT_EQ(run("--help").status, 0);
  EXPECT_EQ(run("gradient --help").status, 0);
}

}  // namespace
}  // namespace limn
