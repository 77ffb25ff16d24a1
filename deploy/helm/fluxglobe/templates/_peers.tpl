{{/* Parts of network policies. */}}

{{/* Pods of this release: dict "root" $ "services" (list NAME...). Items of a `from` or `to`. */}}
{{- define "fluxglobe.peers" -}}
{{- range .services }}
- podSelector:
    matchLabels: {{- include "fluxglobe.selector" (dict "root" $.root "service" .) | nindent 6 }}
{{- end }}
{{- end }}

{{/* Ports: list of numbers. */}}
{{- define "fluxglobe.ports" -}}
{{- range . }}
- {protocol: TCP, port: {{ . }}}
{{- end }}
{{- end }}

{{/* One ingress rule: dict "root" "services" "peers" "ports"; without services and peers anybody may come. */}}
{{- define "fluxglobe.from" -}}
- ports: {{- include "fluxglobe.ports" .ports | trim | nindent 4 }}
  {{- if or .services .peers }}
  from:
    {{- with .services }}{{ include "fluxglobe.peers" (dict "root" $.root "services" .) | trim | nindent 4 }}{{ end }}
    {{- with .peers }}{{ toYaml . | nindent 4 }}{{ end }}
  {{- end }}
{{- end }}

{{/* One egress rule, alike. */}}
{{- define "fluxglobe.to" -}}
- ports: {{- include "fluxglobe.ports" .ports | trim | nindent 4 }}
  {{- if or .services .peers }}
  to:
    {{- with .services }}{{ include "fluxglobe.peers" (dict "root" $.root "services" .) | trim | nindent 4 }}{{ end }}
    {{- with .peers }}{{ toYaml . | nindent 4 }}{{ end }}
  {{- end }}
{{- end }}
