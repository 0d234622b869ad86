// `read_sdf FILE...`: the version of SDFormat that libsdformat reads, then what it says of models and worlds, a line of JSON for each:
// {"mass": kg} or {"cannot": words}.
#include <iomanip>
#include <iostream>

#include <sdf/sdf.hh>

int main(int count, char **files) {
  std::cout << "\"" SDF_PROTOCOL_VERSION "\"" << std::endl;
  for (int k = 1; k < count; ++k) {
    const std::string file(files[k]);
    sdf::ParserConfig config = sdf::ParserConfig::GlobalConfig();
    config.SetWarningsPolicy(sdf::EnforcementPolicy::ERR);
    config.SetUnrecognizedElementsPolicy(sdf::EnforcementPolicy::ERR);
    config.AddURIPath("model://", file.substr(0, file.rfind('/')));
    sdf::Root root;
    const sdf::Errors errors = root.Load(file, config);
    if (!errors.empty()) {
      std::string words;
      for (const char c : errors[0].Message()) words += c == '"' ? '\'' : c == '\n' ? ' ' : c == '\\' ? '/' : c;
      std::cout << "{\"cannot\": \"" << words << "\"}" << std::endl;
      continue;
    }
    double mass = 0.0;
    for (uint64_t link = 0; root.Model() && link < root.Model()->LinkCount(); ++link)
      mass += root.Model()->LinkByIndex(link)->Inertial().MassMatrix().Mass();
    std::cout << "{\"mass\": " << std::setprecision(17) << mass << "}" << std::endl;
  }
}
